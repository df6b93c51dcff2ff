"""`python -m plumbline run|test|setup` on a fresh machine; every other command needs the installed package.

Nothing but the standard library may be imported before the environment exists.
"""

import sys


def main() -> int:
    """Dispatch to the bootstrap or to the command line."""
    from plumbline import bootstrap

    if len(sys.argv) > 1 and sys.argv[1] in bootstrap.COMMANDS:
        return bootstrap.main(sys.argv[1:])
    try:
        from plumbline.cli import main as cli
    except ModuleNotFoundError as missing:
        print(f"{missing.name} is not installed: type `python -m plumbline setup` first", file=sys.stderr)
        return 2
    cli()
    return 0


if __name__ == "__main__":
    sys.exit(main())
