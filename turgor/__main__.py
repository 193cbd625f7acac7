"""``python -m turgor`` is the ``turgor`` command."""

from turgor.cli import main

if __name__ == "__main__":
    main()
