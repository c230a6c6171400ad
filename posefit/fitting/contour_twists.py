"""Twists of a body: the squares of its bones become those of a place and a pose.

A camera's residuals depend on six numbers of each bone in the picture, see
`contour_residuals`. Each degree of freedom of a pose moves many bones, but all of them
by the same twist. So a bone's derivatives by a twist are taken once, and summed over
the bones that move together, before any angle is looked at. This module does that, as
docs/background/contour-fit.md derives in (7) to (14):

    Hessian and gradient of each bone, by its six numbers
         |  add_view: times the derivatives of these numbers by a twist (7) to (9)
    spatial Hessian and force of each bone, summed over the views
         |  composite_hessian: summed over the bones beyond each joint (11),
         |  times the twists of the joint's degrees of freedom (10), (12), (13)
    Hessian and gradient by the place and the pose

A twist is a velocity, then a rotation, as the world's origin sees them. The degrees of
freedom of a frame are the root's place, then the angles of the pose. Hessians and
gradients are halved. The callers check shapes.
"""

import math
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, inlined, jit
from posefit.fitting.contour_residuals import NUMBERS_OF_END, accumulate_borders
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.outlines import NEAR

FREEDOMS = 3 + ANGLES  # degrees of freedom of a place and a pose
# a point of the border has two independent errors, with these standard deviations
BORDER_DEVIATION = 0.01  # metres
PIXEL_DEVIATION = 0.5  # pixels
# metres: a border of this length shares its error, and counts as one measurement
CORRELATION_LENGTH = 0.09
MIN_ROBUST_SCALE = 3.0  # pixels: larger distances count less


class Growth(NamedTuple):
    """How a body changes by F factors of its build, of which there may be none."""

    joints: Array  # (F, 27, 3), or (T, F, 27, 3): derivatives of joints
    radii: Array  # (F, 26, 2): derivatives of radii


class Sums(NamedTuple):
    """Halved second derivatives and gradients, summed over residuals.

    The bones' are of one frame, or of T frames; bones are counted by the joint in which
    they end. The factors' are of all frames.
    """

    hessians: Array  # (27, 6, 6), or (T, 27, 6, 6): spatial Hessians of the bones
    # (27, 6, 1 + F), or (T, 27, 6, 1 + F): spatial forces of the bones, then their
    # derivatives by the F factors
    forces: Array
    # (1 + F, 1 + F): below a row of zeros, the gradient by the factors in the first
    # column, and their second derivatives in the others
    factors: Array


@jit
def add_view(parents, radii, camera, frames, contour, scale, growth, sums):
    """Add the squared distances in one view to the `sums` of the bones.

    `frames` (27, 4, 3) are the joints' coordinate frames. Distances beyond a `scale` in
    metres count less.
    """
    count = parents.size
    centres = np.empty((count + 1, 2))
    per_metre = np.empty(count + 1)
    jacobians = np.empty((count + 1, 3, 3))
    _project_joints(camera, frames, centres, per_metre, jacobians)
    drawn_radii = np.empty((count, 2))
    for b in range(count):
        drawn_radii[b, 0] = per_metre[parents[b]] * radii[b, 0]
        drawn_radii[b, 1] = per_metre[b + 1] * radii[b, 1]
    root_per_metre = per_metre[0]
    pixel_scale = max(scale * root_per_metre, MIN_ROBUST_SCALE)
    blocks = np.zeros((count, 6, 6))
    gradients = np.zeros((count, 6))
    accumulate_borders(
        parents, centres, drawn_radii, contour, pixel_scale, blocks, gradients
    )
    variance = BORDER_DEVIATION**2 + (PIXEL_DEVIATION / root_per_metre) ** 2
    # contour (6): the factor that all residuals of a view share
    weight = 1.0 / (root_per_metre**3 * CORRELATION_LENGTH * variance)
    jacobian = np.empty((6, 6))
    product = np.empty((6, 6))
    for b in range(count):
        block = blocks[b]
        gradient = gradients[b]
        hessian = sums.hessians[b + 1]
        force = sums.forces[b + 1]
        _write_twist_jacobian(b, parents[b], radii, frames, jacobians, jacobian)
        _accumulate_twists(jacobian, block, gradient, weight, product, hessian, force)
        if len(growth.joints):
            columns = _factor_columns(b, parents[b], jacobian, per_metre, growth)
            _accumulate_factors(
                jacobian, columns, block, gradient, weight, force, sums.factors
            )


@inlined
def _project_joints(camera, frames, centres, per_metre, jacobians):
    """Write the joints' pixels (27, 2), pixels per metre (27,), and Jacobians.

    `jacobians` (27, 3, 3) have the derivatives by a joint's place: of its column, of
    its row, and of the pixels per metre.
    """
    rotation, translation, focal, centre = camera
    for j in range(frames.shape[0]):
        x = frames[j, 3, 0]
        y = frames[j, 3, 1]
        z = frames[j, 3, 2]
        a = _camera_coordinate(0, rotation, translation, x, y, z)
        b = _camera_coordinate(1, rotation, translation, x, y, z)
        # joints behind the camera count as right in front of it
        c = max(_camera_coordinate(2, rotation, translation, x, y, z), NEAR)
        centres[j, 0] = a / c * focal[0] + centre[0]
        centres[j, 1] = b / c * focal[1] + centre[1]
        per_metre[j] = math.sqrt(focal[0] * focal[1]) / c
        for i in range(3):  # contour (7)
            r0 = rotation[0, i]
            r1 = rotation[1, i]
            r2 = rotation[2, i]
            jacobians[j, 0, i] = focal[0] / c * (r0 - a / c * r2)
            jacobians[j, 1, i] = focal[1] / c * (r1 - b / c * r2)
            jacobians[j, 2, i] = -per_metre[j] / c * r2


@inlined
def _camera_coordinate(i, rotation, translation, x, y, z):
    """Return the i-th coordinate of a point in the camera's frame, in metres."""
    return rotation[i, 0] * x + rotation[i, 1] * y + rotation[i, 2] * z + translation[i]


@inlined
def _write_twist_jacobian(b, parent, radii, frames, jacobians, jacobian):
    """Write the derivatives (6, 6) of bone b's six numbers by its twist. contour (8).

    `jacobians` (27, 3, 3) are those of `_project_joints`.
    """
    for end in range(2):
        joint = parent if end == 0 else b + 1
        x = frames[joint, 3, 0]
        y = frames[joint, 3, 1]
        z = frames[joint, 3, 2]
        for kind in range(3):
            # a radius in pixels is one in metres times the pixels per metre
            factor = radii[b, end] if kind == 2 else 1.0
            gx = factor * jacobians[joint, kind, 0]
            gy = factor * jacobians[joint, kind, 1]
            gz = factor * jacobians[joint, kind, 2]
            row = jacobian[NUMBERS_OF_END[end, kind]]
            row[0] = gx
            row[1] = gy
            row[2] = gz
            row[3] = y * gz - z * gy
            row[4] = z * gx - x * gz
            row[5] = x * gy - y * gx


@inlined
def _accumulate_twists(jacobian, block, gradient, weight, product, hessian, force):
    """Add a bone's Hessian and gradient to its spatial ones, over twists. contour (9).

    These are J^T B J and J^T f, with the Hessian B and the gradient f by the bone's six
    numbers. `product` (6, 6) is a buffer for B J.
    """
    for i in range(6):
        for j in range(6):
            product[i, j] = 0.0
        for k in range(6):
            for j in range(6):
                product[i, j] += block[i, k] * jacobian[k, j]
    for i in range(6):
        total = 0.0
        for k in range(6):
            total += jacobian[k, i] * gradient[k]
        force[i, 0] += weight * total
        for j in range(6):
            total = 0.0
            for k in range(6):
                total += jacobian[k, i] * product[k, j]
            hessian[i, j] += weight * total


@jit
def _factor_columns(b, parent, jacobian, per_metre, growth):
    """Return the derivatives (6, 1 + F) of bone b's six numbers by the factors.

    A factor moves both joints of the bone and changes both radii. This is b of
    contour (14). Column 0, of the residuals themselves, is 0.
    """
    factors = len(growth.joints)
    columns = np.zeros((6, 1 + factors))
    for end in range(2):
        joint = parent if end == 0 else b + 1
        for kind in range(3):
            k = NUMBERS_OF_END[end, kind]
            for f in range(factors):
                # the first half of a twist is a velocity, as a joint's is
                for i in range(3):
                    columns[k, 1 + f] += jacobian[k, i] * growth.joints[f, joint, i]
                if kind == 2:
                    columns[k, 1 + f] += per_metre[joint] * growth.radii[f, b, end]
    return columns


@jit
def _accumulate_factors(jacobian, columns, block, gradient, weight, force, squares):
    """Add a bone's normal equations by F factors of the build. contour (14).

    With the gradient f as column 0 of B b, the same sums give gradients and second
    derivatives.

    Args:
        jacobian: J (6, 6), derivatives of the bone's numbers by its twist.
        columns: b (6, 1 + F), derivatives of the bone's numbers by the factors.
        block: B (6, 6), the Hessian by the bone's numbers.
        gradient: f (6,), the gradient by the bone's numbers.
        weight: The factor that all residuals of the view share.
        force: The spatial force (6, 1 + F) of the bone, incremented by J^T B b.
        squares: The sums (1 + F, 1 + F) of the factors, incremented by b^T B b.
    """
    factors = columns.shape[1] - 1
    products = np.zeros((6, 1 + factors))  # B b
    for k in range(6):
        products[k, 0] = weight * gradient[k]
        for i in range(6):
            for f in range(factors):
                products[k, 1 + f] += weight * block[k, i] * columns[i, 1 + f]
    for k in range(6):
        for f in range(1 + factors):
            for g in range(1 + factors):
                squares[f, g] += columns[k, f] * products[k, g]
            # `_accumulate_twists` has added column 0 of the force
            for i in range(6 if f else 0):
                force[i, f] += jacobian[k, i] * products[k, f]


@jit
def write_twists(chain, frames, sines, cosines, twists):
    """Write the twists (69, 6) of the degrees of freedom of a frame. contour (10)."""
    twists[:] = 0.0
    root = frames[0, 3]
    axes = np.empty((3, 3))
    # yaw turns about the world's vertical, pitch about an axis that yaw has turned, and
    # roll about an axis of the body
    axes[0, 0] = 0.0
    axes[0, 1] = 1.0
    axes[0, 2] = 0.0
    axes[1, 0] = cosines[0]
    axes[1, 1] = 0.0
    axes[1, 2] = -sines[0]
    for i in range(3):
        axes[2, i] = frames[0, 2, i]
    for k in range(3):
        twists[k, k] = 1.0
        _write_rotation(twists[3 + k], axes[k], root)
    for b in range(chain.parents.size):
        a = chain.angles[b]
        if a < 0:
            continue
        pivot = frames[chain.parents[b], 3]
        frame = frames[b + 1]
        # A bone turns about z, then y, then x. So its turn about x has the frame's own
        # axis, and the axes of the other two follow by undoing the turns after them.
        for i in range(3):
            u = frame[0, i]
            v = frame[1, i]
            w = frame[2, i]
            axes[0, i] = u
            axes[1, i] = v * cosines[a] - w * sines[a]
            before = w * cosines[a] + v * sines[a]
            axes[2, i] = before * cosines[a + 1] - u * sines[a + 1]
        for k in range(3):
            _write_rotation(twists[3 + a + k], axes[k], pivot)


@inlined
def _write_rotation(twist, axis, pivot):
    """Write the twist of a rotation about an axis through a point."""
    twist[0] = pivot[1] * axis[2] - pivot[2] * axis[1]
    twist[1] = pivot[2] * axis[0] - pivot[0] * axis[2]
    twist[2] = pivot[0] * axis[1] - pivot[1] * axis[0]
    twist[3] = axis[0]
    twist[4] = axis[1]
    twist[5] = axis[2]


@jit
def composite_hessian(chain, twists, hessians, forces, matrix, gradients):
    """Write the derivatives by a place and a pose, from the bones' Hessians and forces.

    This is the composite-rigid-body algorithm, with spatial Hessians in place of
    spatial inertias.

    Args:
        chain: The skeleton's.
        twists: The twists (69, 6) of the degrees of freedom, 0 for one that is held.
        hessians: Spatial Hessians of the bones. Each is overwritten with the sum over
            all bones that move with the joint.
        forces: Spatial forces of the bones, overwritten in the same way.
        matrix: Second derivatives (69, 69); only the lower half is written.
        gradients: The gradient and its derivatives by factors (69, 1 + F).
    """
    parents = chain.parents
    _sum_towards_root(parents, hessians, forces)
    matrix[:] = 0.0
    gradients[:] = 0.0
    product = np.empty(6)  # of a joint's Hessian and a twist
    for joint in range(parents.size + 1):
        first, stop = _freedoms_of(chain, joint)
        for a in range(first, stop):
            if not twists[a].any():
                continue
            for i in range(6):
                total = 0.0
                for j in range(6):
                    total += hessians[joint, i, j] * twists[a, j]
                product[i] = total
                # contour (12)
                for f in range(gradients.shape[1]):
                    gradients[a, f] += twists[a, i] * forces[joint, i, f]
            # the joint itself, and all joints between it and the root
            ancestor = joint
            while True:
                start, end = _freedoms_of(chain, ancestor)
                for c in range(start, min(end, a + 1)):
                    total = 0.0
                    for i in range(6):
                        total += twists[c, i] * product[i]
                    matrix[a, c] = total  # contour (13)
                if ancestor == 0:
                    break
                ancestor = parents[ancestor - 1]


@inlined
def _sum_towards_root(parents, hessians, forces):
    """Add what moves with each joint to its parent, limbs' ends first. contour (11)."""
    for b in range(parents.size - 1, -1, -1):
        p = parents[b]
        for i in range(6):
            for j in range(6):
                hessians[p, i, j] += hessians[b + 1, i, j]
            for f in range(forces.shape[2]):
                forces[p, i, f] += forces[b + 1, i, f]


@inlined
def _freedoms_of(chain, joint):
    """Return the first degree of freedom at a joint, and the one after the last.

    They move the joint if it is the root, and turn the bone that ends in it otherwise.
    """
    if joint == 0:
        return 0, 6
    a = chain.angles[joint - 1]
    return (3 + a, 6 + a) if a >= 0 else (0, 0)
