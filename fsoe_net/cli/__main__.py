"""``python -m fsoe_net.cli``."""

from fsoe_net.cli.main import main

if __name__ == "__main__":
    main()
