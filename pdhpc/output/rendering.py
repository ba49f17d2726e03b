"""Particles of a 3D body as a camera sees them: balls behind a depth buffer, chunk by chunk, so that memory is bounded by the picture."""
import math
from typing import NamedTuple

import numpy as np

from pdhpc.jit import kernel

_LIGHT = np.array([-0.35, 0.45, 0.82])  # to the right, up, towards the camera
_AMBIENT = 0.45  # share of the light that comes from everywhere
_STEEPEST = 4.0  # slope of depth beyond which two balls are not one surface


class Camera(NamedTuple):
    """A camera far away: unit vectors (3,) to the right of the picture, up, and towards the camera."""

    right: np.ndarray
    up: np.ndarray
    toward: np.ndarray

    @classmethod
    def at(cls, azimuth, elevation):
        """Return the camera in a direction, degrees: azimuth from x towards y, elevation above the xy plane; z is up in the picture."""
        a, e = math.radians(azimuth), math.radians(elevation)
        right = np.array([-math.sin(a), math.cos(a), 0.0])
        toward = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        return cls(right, np.cross(toward, right), toward)

    def extent(self, lower, upper):
        """Return (low, high), (2,) m both: the frame of the picture around a box."""
        corners = np.array(np.meshgrid(*zip(lower, upper), indexing="ij")).reshape(3, -1).T
        flat = corners @ np.stack([self.right, self.up], axis=1)
        return flat.min(axis=0), flat.max(axis=0)


class Canvas:
    """A picture that balls are drawn on; the nearest is seen.

    value (rows, columns) : of the ball in each pixel, NaN where none is. depth : m, towards the camera, -inf where none is. pixel : its side, m.
    """

    def __init__(self, camera, low, high, longest):
        """low, high : (2,) m, the frame; longest : pixels along its longer side."""
        self.camera, self.low = camera, np.asarray(low, float)
        size = np.maximum(np.asarray(high, float) - self.low, 1e-300)
        self.pixel = float(size.max()) / longest
        columns, rows = np.maximum(1, np.ceil(size / self.pixel - 1e-6)).astype(int)
        self.value, self.depth = np.full((rows, columns), np.nan), np.full((rows, columns), -np.inf)

    @property
    def extent(self):
        """(left, right, bottom, top), m."""
        rows, columns = self.value.shape
        return self.low[0], self.low[0] + columns * self.pixel, self.low[1], self.low[1] + rows * self.pixel

    def draw(self, points, radius, values):
        """Draw balls around points (n, 3), m, of radius (n,), m, that show values (n,)."""
        axes = np.stack([self.camera.right, self.camera.up, self.camera.toward], axis=1)
        seen = np.ascontiguousarray(np.asarray(points, float) @ axes)
        seen[:, :2] -= self.low
        draw_balls(seen, np.ascontiguousarray(radius, dtype=float), np.ascontiguousarray(values, dtype=float), self.pixel, self.value, self.depth)

    def light(self):
        """Return (rows, columns), 0 to 1: how bright a matt surface of this depth is, 1 where there is none."""
        return light_of(self.depth, self.pixel)


def light_of(depth, pixel):
    """Return (rows, columns), 0 to 1: how bright a matt surface of a depth, m, is, -inf where there is none and 1 there; pixel : its side, m."""
    from scipy.ndimage import gaussian_filter

    covered = np.isfinite(depth)
    if not covered.any():
        return np.ones_like(depth)
    weight = gaussian_filter(covered.astype(float), 1.5)
    smooth = gaussian_filter(np.where(covered, depth, 0.0), 1.5) / np.maximum(weight, 1e-12)  # of what is covered alone
    slope = np.clip(np.stack([np.gradient(smooth, axis=1), np.gradient(smooth, axis=0)]) / pixel, -_STEEPEST, _STEEPEST) if min(smooth.shape) > 1 else np.zeros((2, *smooth.shape))
    normal = np.stack([-slope[0], -slope[1], np.ones_like(smooth)]) / np.sqrt(1.0 + (slope**2).sum(axis=0))
    facing = np.clip(np.tensordot(_LIGHT / np.linalg.norm(_LIGHT), normal, axes=1), 0.0, 1.0)
    return np.where(covered, _AMBIENT + (1.0 - _AMBIENT) * facing, 1.0)


@kernel
def draw_balls(seen, radius, values, pixel, value, depth):
    """Put balls on a canvas: seen (n, 3), m, to the right and up from its corner, towards the camera; value, depth (rows, columns).

    Pixel (r, c) is covered where its centre is within the radius; each ball covers at least the pixel its centre is in. NaN is drawn nowhere.
    """
    rows, columns = value.shape
    for n in range(len(seen)):
        x, y, z, reach = seen[n, 0], seen[n, 1], seen[n, 2], radius[n]
        if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)) or np.isnan(values[n]):
            continue
        if x < -reach or y < -reach or x > columns * pixel + reach or y > rows * pixel + reach:
            continue
        home_r, home_c = int(np.floor(y / pixel)), int(np.floor(x / pixel))
        for r in range(max(0, int(np.floor((y - reach) / pixel))), min(rows - 1, int(np.floor((y + reach) / pixel))) + 1):
            for c in range(max(0, int(np.floor((x - reach) / pixel))), min(columns - 1, int(np.floor((x + reach) / pixel))) + 1):
                dx, dy = (c + 0.5) * pixel - x, (r + 0.5) * pixel - y
                rest = reach * reach - dx * dx - dy * dy
                if rest < 0.0 and not (r == home_r and c == home_c):
                    continue
                near = z + np.sqrt(max(rest, 0.0))
                if near > depth[r, c]:
                    depth[r, c], value[r, c] = near, values[n]
