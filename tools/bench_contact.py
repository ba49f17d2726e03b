"""The speed of contact: the disc of runs/brittle_impact.toml, at a radius of 16 mm, ground to debris. See bench.py."""
import json
import sys
from pathlib import Path

SCENE = Path(__file__).resolve().parents[1] / "runs" / "brittle_impact.toml"
SMALLER = ["body.disc.radius=16e-3", "output.pictures=false"]


def contact(worker, spread):
    """Print the time beside the bonds, nearly all of it contact, over that of the bonds; worker, spread : of bench.py."""
    for ranks in (1, 2):
        results = [worker(["contact-rank"], ranks=ranks) for _ in range(3)]
        print(f"contact: {ranks} rank(s): {spread([each['beside'] / each['force'] for each in results])} times the bonds, {results[0]['lists']} lists in {results[0]['steps']} steps")


def contact_rank():
    """One rank of `contact`: seconds of the bonds, and of all that is neither bonds nor messages, of which contact is nearly all; lists made and steps."""
    from pdhpc.simulation import Simulation

    simulation = Simulation.from_file(SCENE, SMALLER)
    record = simulation.run(quiet=True)
    seconds = record["seconds"]
    if simulation.comm.rank == 0:
        beside = seconds["integrate"] + seconds.get("contact", 0.0)
        print(json.dumps({"force": seconds["force"], "beside": beside, "lists": record["contact"]["lists_made"], "steps": record["steps"]}))
        sys.stdout.flush()
