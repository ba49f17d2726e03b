"""`python -m pdhpc` is the program."""
from pdhpc.cli import main

main()
