"""Forward kinematics on a device: the steps of `posefit.geometry.kernels` and `lanes`, a thread for each world axis."""

from numba import cuda

from posefit.silhouette.cuda.arithmetic import floored

_PI_HIGH, _PI_LOW = 3.141592653589793, 1.2246467991473532e-16  # pi in two parts, as on a CPU


@cuda.jit(device=True)
def write_sine(i, angle, sines, cosines):
    """Write the sine and cosine of one angle, by the polynomials of a CPU."""
    turns = floored(angle * (1.0 / _PI_HIGH) + 0.5)
    x = (angle - turns * _PI_HIGH) - turns * _PI_LOW
    sign = 1.0 - 2.0 * (turns - 2.0 * floored(0.5 * turns))
    z = x * x
    s = -1.0 / 1307674368000.0
    s = s * z + 1.0 / 6227020800.0
    s = s * z - 1.0 / 39916800.0
    s = s * z + 1.0 / 362880.0
    s = s * z - 1.0 / 5040.0
    s = s * z + 1.0 / 120.0
    s = s * z - 1.0 / 6.0
    sines[i] = sign * (x + x * z * s)
    c = 1.0 / 20922789888000.0
    c = c * z - 1.0 / 87178291200.0
    c = c * z + 1.0 / 479001600.0
    c = c * z - 1.0 / 3628800.0
    c = c * z + 1.0 / 40320.0
    c = c * z - 1.0 / 720.0
    c = c * z + 1.0 / 24.0
    c = c * z - 0.5
    cosines[i] = sign * (1.0 + z * c)


@cuda.jit(device=True)
def place_root(i, place, sines, cosines, frames):
    """Write world coordinate i of the root's three axes and of its place."""
    sy, sp, sr = sines[0], sines[1], sines[2]
    cy, cp, cr = cosines[0], cosines[1], cosines[2]
    if i == 0:
        frames[0, 0, i] = cy * cr + sy * sp * sr
        frames[0, 1, i] = sy * sp * cr - cy * sr
        frames[0, 2, i] = sy * cp
    elif i == 1:
        frames[0, 0, i] = cp * sr
        frames[0, 1, i] = cp * cr
        frames[0, 2, i] = -sp
    else:
        frames[0, 0, i] = cy * sp * sr - sy * cr
        frames[0, 1, i] = cy * sp * cr + sy * sr
        frames[0, 2, i] = cy * cp
    frames[0, 3, i] = place


@cuda.jit(device=True)
def place_bones(i, starts, angles, turned, turns, offsets, sines, cosines, frames):
    """Write world coordinate i of all frames (27, 4, 3) beyond the root's: no axis asks for another one."""
    for b in range(starts.size):
        p, a = starts[b], angles[b]
        u, v, w = frames[p, 0, i], frames[p, 1, i], frames[p, 2, i]
        if turned[b]:
            first = u * turns[b, 0, 0] + v * turns[b, 1, 0] + w * turns[b, 2, 0]
            second = u * turns[b, 0, 1] + v * turns[b, 1, 1] + w * turns[b, 2, 1]
            w = u * turns[b, 0, 2] + v * turns[b, 1, 2] + w * turns[b, 2, 2]
            u, v = first, second
        if a >= 0:  # Rz @ Ry @ Rx
            first = u * cosines[a + 2] + v * sines[a + 2]
            v = v * cosines[a + 2] - u * sines[a + 2]
            u = first * cosines[a + 1] - w * sines[a + 1]
            w = w * cosines[a + 1] + first * sines[a + 1]
            first = v * cosines[a] + w * sines[a]
            w = w * cosines[a] - v * sines[a]
            v = first
        frames[b + 1, 0, i], frames[b + 1, 1, i], frames[b + 1, 2, i] = u, v, w
        frames[b + 1, 3, i] = frames[p, 3, i] + u * offsets[b, 0] + v * offsets[b, 1] + w * offsets[b, 2]
