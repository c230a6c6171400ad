"""Many scenes at once: numba loops over stacked arrays, a row a scene. Shapes are checked by the callers.

Each row is computed as one alone is, by the same inner functions, so that its bits do not depend on its neighbours.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits, jit
from posefit.fitting.kernels import move_to_borders, unpack_proposals
from posefit.geometry.kernels import Chain, empty_frames, place_joints
from posefit.silhouette.kernels import count, paint_bits
from posefit.silhouette.rasteriser import View, draw_pose, scratch
from posefit_swarm.kernels import step


class Scenes(NamedTuple):
    """What the drawn scenes (n) differ in: bodies, cameras, silhouettes and pictures."""

    offsets: Array  # (n, 26, 3) bones in their own frames
    radii: Array  # (n, 26, 2)
    rotations: Array  # (n, views, 3, 3) camera_from_world
    places: Array  # (n, views, 3) the cameras' translations
    focals: Array  # (n, views, 2) pixels
    centres: Array  # (n, views, 2) pixels
    observed: Bits  # (n, views, ...) bit images
    valid: Bits  # (n, views, ...) bit images
    totals: NDArray[np.int64]  # (n, views) pixels of the silhouettes
    backdrops: NDArray[np.uint16]  # (n, height, width, views)


@jit
def unpack_scenes(proposals, centres, halves, anchors, first, poses, translations, latents):
    """Write root angles, translations and latents of proposals (n, k, d); return whether all of them are finite."""
    finite, upright = True, np.zeros((3 + latents.shape[2], 2))
    for i in range(proposals.shape[0]):
        finite &= unpack_proposals(
            proposals[i], centres[i], halves[i], anchors[i], first, upright, poses[i], translations[i], latents[i]
        )
    return finite


@jit
def align_scenes(chain, scenes, joint_radii, borders, rows, poses, translations):
    """Move translations (n, k, 3) of some rows to where poses (n, k, 66) fill the borders (n, views, 4)."""
    bones, many = chain.parents.size, poses.shape[1]
    sines, cosines, origin = np.empty(poses.shape[2]), np.empty(poses.shape[2]), np.zeros(3)
    frames, joints = empty_frames(bones + 1), np.empty((many, bones + 1, 3))
    for i in rows:
        own = Chain(chain.parents, chain.angles, chain.turns, chain.turned, scenes.offsets[i])
        for k in range(many):
            place_joints(own, poses[i, k], origin, sines, cosines, frames, joints[k])
        move_to_borders(
            joints,
            joint_radii[i],
            scenes.rotations[i],
            scenes.places[i],
            scenes.focals[i],
            scenes.centres[i],
            borders[i],
            translations[i],
        )


@jit
def draw_scenes(chain, scenes, width, height, rows, poses, translations, areas, value, pictures):
    """Write the areas (views, n, k, 3) R, B, Y of poses (n, k, 66) in some rows, each in its own scene.

    Where there are `pictures` (n, height, width, views), and k is 1, they become the backdrops with `value` in the
    pixels of each body; those of other rows stay as they are.
    """
    views, bones = scenes.places.shape[1], chain.parents.size
    rotations, places, focals, centres = scenes.rotations, scenes.places, scenes.focals, scenes.centres
    work = scratch(
        View(rotations[0, 0], places[0, 0], focals[0, 0], centres[0, 0], width, height), bones, poses.shape[2]
    )
    for i in rows:
        own = Chain(chain.parents, chain.angles, chain.turns, chain.turned, scenes.offsets[i])
        if pictures.size:
            pixels, backdrop = pictures[i].reshape(-1), scenes.backdrops[i].reshape(-1)
            for p in range(pixels.size):
                pixels[p] = backdrop[p]
        for v in range(views):
            view = View(rotations[i, v], places[i, v], focals[i, v], centres[i, v], width, height)
            for k in range(poses.shape[1]):
                image, box = draw_pose(own, scenes.radii[i], view, poses[i, k], translations[i, k], work)
                if pictures.size:
                    paint_bits(image, box, value, pictures[i, :, :, v])
                body, overlap = count(image, scenes.observed[i, v], scenes.valid[i, v], box)
                areas[v, i, k, 0] = np.uint64(scenes.totals[i, v]) - overlap
                areas[v, i, k, 1] = body - overlap
                areas[v, i, k, 2] = overlap


class Swarms(NamedTuple):
    """The particle swarms of environments (n), k in each, with m particles."""

    positions: Array  # (n, k, m, d)
    velocities: Array  # (n, k, m, d)
    bests: Array  # (n, k, m, d) of the particles
    best_costs: Array  # (n, k, m)
    leaders: NDArray[np.int64]  # (n, k) the particle with the best of them
    costs: Array  # (n, k) its cost
    spreads: Array  # (n, k) standard deviation of the bests, mean over coordinates


@jit
def move_swarms(rows, chosen, rand, omega, acceleration, most, periodic, swarms, moved):
    """Write the particles (n, m, d) of the `chosen` (n,) swarms of some rows after their next move, with `rand` drawn.

    Those are draws (n, 2, m, d) for the pulls towards a particle's best and the swarm's. Speeds are at most `most`;
    what leaves the box stops at its border.
    """
    for i in rows:
        s = chosen[i]
        bests, velocities, leader = swarms.bests[i, s], swarms.velocities[i, s], swarms.leaders[i, s]
        for k in range(moved.shape[1]):
            for j in range(moved.shape[2]):
                r1, r2 = rand[i, 0, k, j], rand[i, 1, k, j]
                x, v, p, g = swarms.positions[i, s, k, j], velocities[k, j], bests[k, j], bests[leader, j]
                v, x, within = step(r1, r2, omega, acceleration, x, v, p, g, -most, most, periodic[j], True)
                velocities[k, j] = v if within else 0.0
                moved[i, k, j] = min(max(x, -1.0), 1.0)


@jit
def teach_swarms(rows, chosen, moved, costs, swarms):
    """Give the `chosen` (n,) swarms of some rows their particles' positions (n, m, d) and costs (n, m)."""
    particles, d = moved.shape[1:]
    for i in rows:
        s = chosen[i]
        bests, best_costs, leader = swarms.bests[i, s], swarms.best_costs[i, s], swarms.leaders[i, s]
        for k in range(particles):
            better = costs[i, k] < best_costs[k]
            if better:
                best_costs[k] = costs[i, k]
            for j in range(d):
                swarms.positions[i, s, k, j] = moved[i, k, j]
                if better:
                    bests[k, j] = moved[i, k, j]
            if best_costs[k] < best_costs[leader]:
                leader = k
        spread = 0.0
        for j in range(d):
            mean, square = 0.0, 0.0
            for k in range(particles):
                mean += bests[k, j] / particles
            for k in range(particles):
                square += (bests[k, j] - mean) ** 2 / particles
            spread += np.sqrt(square) / d
        swarms.leaders[i, s], swarms.costs[i, s], swarms.spreads[i, s] = leader, best_costs[leader], spread
