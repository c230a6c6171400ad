#!/bin/sh
# OpenCV 5.0.0: cv2.VideoWriter writes an .mp4 (mp4v) of 119.88 or 1000 frames a second, and none of 119.8765.
#
# OpenCV turns the rate into a decimal fraction with as many places as it needs to be within a thousandth, at most
# three: 119877 / 1000. MPEG-4 part 2 counts time in at most 65,535 parts of a second, so that the encoder refuses
# it: `isOpened()` is False, and nothing says why. Below 65.5 a second every rate is taken, but not kept: 23.879 is
# 23.88 in the file. Whoever writes at a measured rate rounds it to two decimals first (one above 655).
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet opencv-python-headless==5.0.0.93 numpy==2.4.6
cd "$folder"
OPENCV_LOG_LEVEL=SILENT OPENCV_FFMPEG_LOGLEVEL=-8 venv/bin/python - <<'PYTHON'
import cv2
import numpy as np

print("OpenCV", cv2.__version__)
expected = {
    119.88: 119.88,
    119.8765: None,
    239.84: 239.84,
    239.8367: None,
    1000.0: 1000.0,
    23.879: 23.88,
}
unchanged = True
for fps, seen in expected.items():
    name = f"{fps}.mp4"
    writer = cv2.VideoWriter(name, cv2.VideoWriter.fourcc(*"mp4v"), fps, (64, 48))
    rate = None
    if writer.isOpened():
        for _ in range(5):
            writer.write(np.zeros((48, 64, 3), np.uint8))
        writer.release()
        rate = cv2.VideoCapture(name).get(cv2.CAP_PROP_FPS)
    print(f"{fps}: {'not opened' if rate is None else f'{rate} in the file'}")
    unchanged = unchanged and (rate is None) == (seen is None)
    unchanged = unchanged and (seen is None or abs(rate - seen) < 1e-6)
raise SystemExit(not unchanged)
PYTHON
