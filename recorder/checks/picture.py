"""Opens a Rerun file in a viewer without a window and takes a picture: picture.py RERUN x.rrd out.png"""

import socket
import subprocess
import sys
import time

from rerun.experimental import ViewerClient

rerun, rrd, picture = sys.argv[1:4]
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
viewer = subprocess.Popen(
    [rerun, rrd, "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1400x788"],
    stdout=subprocess.DEVNULL,
    stderr=subprocess.DEVNULL,
)
try:
    time.sleep(9)  # the viewer's notices cover the picture until then
    ViewerClient(f"127.0.0.1:{port}").save_screenshot(picture)
finally:
    viewer.terminate()
    viewer.wait()
print(picture)
