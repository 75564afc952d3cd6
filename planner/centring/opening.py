"""Which robot is meant by ``--robot``."""

from urllib.parse import urlsplit

from planner.centring.kuka import KukaLink
from planner.centring.kukavarproxy import PORT
from planner.centring.link import RobotLink
from planner.centring.settings import RobotFile
from planner.centring.stopping import Stop
from planner.errors import InputError


def open_link(address: str, n_joints: int, how: RobotFile, stop: Stop, follow: bool = False) -> RobotLink:
    """Connect to the robot at ``tcp://HOST[:PORT]``, a KUKA controller with KUKAVARPROXY (port 7000).

    With ``follow`` the plan's own program drives the robot.

    Raises:
        InputError: no such form of address.
        LinkError: nobody answers there, or the centring program does not run.
    """
    try:
        url = urlsplit(address)
        host, port = url.hostname, url.port
    except ValueError:
        url, host, port = urlsplit(""), None, None
    if url.scheme != "tcp" or not host or url.path not in ("", "/"):
        raise InputError(f"--robot {address}: an address is tcp://HOST or tcp://HOST:PORT (KUKAVARPROXY, port {PORT})")
    return KukaLink(host, port or PORT, n_joints, how, stop, follow)
