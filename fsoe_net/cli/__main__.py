"""``python -m fsoe_net.cli``."""

from fsoe_net.cli import start

if __name__ == "__main__":
    start()
