"""`python -m fig2mesh`."""

from fig2mesh.commands.main import main

if __name__ == "__main__":
    raise SystemExit(main())
