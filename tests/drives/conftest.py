"""What a busy machine needs: time for an answer."""

from canopen.sdo.client import SdoClient

SdoClient.RESPONSE_TIMEOUT = 10.0
