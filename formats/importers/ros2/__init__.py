"""ROS 2 bags, read without ROS through ``rosbags``, the extra ``echoset[ros]``."""

from .importer import SUMMARY, listing, read, recognises, windows
from .params import Params

__all__ = ["SUMMARY", "Params", "listing", "read", "recognises", "windows"]
