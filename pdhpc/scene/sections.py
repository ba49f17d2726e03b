"""What the rules between keys have in common: how tables are called, and references from one to another."""
from pdhpc.scene.fields import Rule
from pdhpc.scene.sentences import listed, nearest


def section(name, number, table):
    """Return how a table of a list is called: load 'pull', or load[2] without a name."""
    label = getattr(table, "name", None)
    return f"{name} '{label}'" if label else f"{name}[{number}]"


def within(where, action, *arguments):
    """Call a check and put the section before the key of the Rule it raises."""
    try:
        action(*arguments)
    except Rule as rule:
        raise Rule(f"{where}: {rule.key}", rule.found, rule.allowed) from None


def named(tables, name):
    """Raise a Rule when two tables share a name."""
    seen = {}
    for number, table in enumerate(tables):
        if table.name is not None and table.name in seen:
            raise Rule(f"{name}[{number}]: name", f'"{table.name}", which {name}[{seen[table.name]}] has too', f"a name that no other {name} has")
        seen[table.name] = number


def reference(key, name, names, what):
    """Raise a Rule unless `name` is one of `names`."""
    if name not in names:
        raise Rule(key, f'"{name}"', f"the name of a {what} ({listed(sorted(names)) or 'none is defined'}){nearest(name, names)}")
