"""ROS 2 bags, read without ROS through ``rosbags``, the extra ``echoset[ros]``."""

from .importer import SUMMARY, Params, listing, read, recognises, windows

__all__ = ["SUMMARY", "Params", "listing", "read", "recognises", "windows"]
