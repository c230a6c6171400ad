"""Mutants of the program, and the test that each must fail: `python -m tests.mutants [WORD ...]`.

The program is copied into a temporary folder, once for each core. Its tests pass there as it is; then one mutant after
the other is put into a copy as a replacement of text, its own test is run and has to fail. Prints a table, and exits with 1 where a
mutant lives; with 2 where a text that a mutant replaces is no longer there, or stands there more than once. Words
choose the mutants whose descriptions hold one of them.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPIED = ("posefit", "plugins", "envs", "tests", "pyproject.toml")
PATHS = (".", "plugins", "envs")
MOST_COPIES = 4  # each compiles anew what its tests call


@dataclass(frozen=True)
class Mutant:
    """A change that a test has to notice: in the file at `path`, texts become others."""

    what: str
    path: str
    changes: tuple[tuple[str, str], ...]
    test: str


MUTANTS = (
    Mutant(
        "a limb fades by the interval of 50 %, not by that of 80 %",
        "posefit/tracking/picture.py",
        (("LEVELS.index(0.8)", "LEVELS.index(0.5)"),),
        "tests/tracking/test_picture.py::test_an_unsure_limb_fades_on_the_masks_and_beside_them",
    ),
    Mutant(
        "the other mode is the second one, whichever the told pose is of",
        "posefit/uncertainty/modes.py",
        (("    rest = [mode for k, mode in enumerate(modes) if k != mine]", "    rest = list(modes[1:])"),),
        "tests/uncertainty/test_modes.py::test_the_other_mode_is_the_likeliest_that_a_pose_is_not_of",
    ),
    Mutant(
        "runs count alike in a reliability diagram, however many frames they have of a bin",
        "posefit/report/runs.py",
        (("+= count * np.array([1.0, told, right])", "+= np.array([1.0, told, right])"),),
        "tests/report/test_contest.py::test_certainty_is_pooled_over_runs_frame_by_frame",
    ),
    Mutant(
        "the viewer of a long track has the marks of those frames alone that it shows",
        "posefit/tracking/page/content.py",
        (("for k, one in enumerate(said) if one}", "for k, one in enumerate(said) if one and k % step == 0}"),),
        "tests/tracking/test_viewer_data.py::test_a_frame_that_is_shown_bears_the_marks_of_those_that_it_stands_for",
    ),
    Mutant(
        "a track that is drawn steps anywhere, not where the last state goes on to",
        "plugins/posefit_exemplars/sampling.py",
        (("likely = first.kernel[rows] * likely", "likely = 1.0 * likely"),),
        "tests/sources/test_posterior.py::test_ways_are_drawn_as_often_as_they_are_likely",
    ),
    Mutant(
        "a posterior does not look ahead",
        "plugins/posefit_exemplars/sampling.py",
        (("power * messages(window, power)", "power"),),
        "tests/exemplars/test_sampling.py::test_the_truth_is_as_likely_to_have_any_rank_among_the_ways",
    ),
    Mutant(
        "a clip that is to come counts for nothing in a conformal factor",
        "posefit/uncertainty/calibration.py",
        (("1.0 / (len(one) * (clips + 1))", "1.0 / (len(one) * clips)"),),
        "tests/sources/test_posterior.py::test_clips_count_alike_and_the_one_to_come_as_infinitely_far",
    ),
    Mutant(
        "joints of a frame that was held are told to other programs",
        "posefit/tracking/evaluation.py",
        (('if not row["usable"] or row["lost"]', 'if row["lost"]'),),
        "tests/tracking/test_certainty.py::"
        "test_what_is_held_or_lost_is_blank_for_other_programs_and_marked_in_the_table",
    ),
    Mutant(
        "a knee bends forwards",
        "posefit/measuring/angles.py",
        (("* [-1.0, 1.0, 1.0]", "* [1.0, 1.0, 1.0]"),),
        "tests/sources/test_measuring.py::test_a_knee_bends_backwards",
    ),
    Mutant(
        "a left side is measured without the mirror",
        "posefit/measuring/angles.py",
        (('if side == "left" else one', 'if side == "none" else one'),),
        "tests/measuring/test_angles.py::test_who_is_mirrored_has_the_other_sides_angles",
    ),
    Mutant(
        "points that nobody saw lie at the origin of a .c3d",
        "posefit/measuring/c3d.py",
        (("(0.0, 0.0, 0.0, -1.0)", "(0.0, 0.0, 0.0, 0.0)"),),
        "tests/measuring/test_files.py::test_a_c3d_is_what_another_reader_reads",
    ),
    Mutant(
        "steps beside an unknown frame count",
        "posefit/measuring/gait.py",
        (("unknown & set(range(int(start), int(end) + 2))", "False"),),
        "tests/measuring/test_gait.py::test_steps_that_touch_an_unknown_frame_count_for_nothing",
    ),
    Mutant(
        "what renders a tracker's observations counts as its evaluations",
        "posefit/fitting/validation.py",
        (("with uncounted():", "if True:"),),
        "tests/tracking/test_audit.py::test_a_track_is_marked_by_a_warning_and_has_the_hosts_figures",
    ),
    Mutant(
        "a tracker that looks ahead is held to have drawn in secret",
        "posefit/fitting/validation.py",
        (("self._task.evaluations * (stream.count - given)", "0 * (stream.count - given)"),),
        "tests/tracking/test_audit.py::test_a_tracker_that_looks_ahead_is_honest",
    ),
    Mutant(
        "velocities of SAPSO (7) are not clipped to the limits",
        "plugins/posefit_swarm/swarm.py",
        (("return np.clip(drawn, *self._limits)", "return drawn"),),
        "tests/sources/test_sapso.py::test_eq_7_velocities_of_the_first_population_keep_within_the_limits",
    ),
    Mutant(
        "CMA-ES learns from the long way round a circle",
        "plugins/posefit_evolution/cma.py",
        (("if round_trip else proposals", "if False else proposals"),),
        "tests/plugins/test_evolution.py::test_a_target_at_the_seam_of_a_circle_is_found[1]",
    ),
    Mutant(
        "the covariance of CMA-ES follows its path however long the step size's is",
        "posefit/evolution/kernels.py",
        (("heeded = 1.0 if long / settled < (1.4 + 2.0 / (d + 1.0)) * chi else 0.0", "heeded = 1.0"),),
        "tests/sources/test_hansen2016.py::test_h_sigma_stops_the_covariances_path_where_the_step_sizes_is_too_long",
    ),
    Mutant(
        "Wald's two error rates are swapped",
        "plugins/posefit_vsmm/switching.py",
        (
            ("np.log((1.0 - how.miss) / how.false_alarm)", "np.log((1.0 - how.false_alarm) / how.miss)"),
            ("np.log(how.miss / (1.0 - how.false_alarm))", "np.log(how.false_alarm / (1.0 - how.miss))"),
        ),
        "tests/sources/test_vsmm_steps.py::test_the_sequential_tests_two_error_rates_are_walds",
    ),
    Mutant(
        "the mean of several turns is sought in one step instead of ten",
        "plugins/posefit_vsmm.imm/filter.py",
        (("\nTURNS = 10 ", "\nTURNS = 1 "),),
        "tests/sources/test_vsmm.py::test_the_mean_of_turns_about_three_axes_is_where_their_errors_balance",
    ),
    Mutant(
        "the joint tracker's yaw and pitch ranges are permuted",
        "plugins/posefit_vsmm/joined.py",
        (("[[*YAW_PITCH_ROLL]]", "[[*YAW_PITCH_ROLL]][[1, 0, 2]]"),),
        "tests/plugins/test_vsmm.py::test_each_angle_of_the_root_is_searched_as_far_as_the_filter_is_unsure_of_it",
    ),
    Mutant(
        "of two equal rows of a ledger the later counts",
        "posefit/sweep/ledger.py",
        (("min((name, offset), self._places.get(found[0], (name, offset)))", "(name, offset)"),),
        "tests/sweep/test_ledger.py::test_of_two_rows_of_one_cell_the_first_counts",
    ),
    Mutant(
        "of two equal rows of a ledger the one that was read first counts, whichever that is",
        "posefit/sweep/ledger.py",
        (
            (
                "min((name, offset), self._places.get(found[0], (name, offset)))",
                "self._places.get(found[0], (name, offset))",
            ),
        ),
        "tests/sweep/test_ledger.py::test_of_two_rows_of_one_cell_the_first_counts",
    ),
    Mutant(
        "a row's checksum leaves out the key",
        "posefit/sweep/log.py",
        (
            ("zlib.crc32(key.encode() + text)", "zlib.crc32(text)"),
            ("zlib.crc32(found[1] + found[3])", "zlib.crc32(found[3])"),
        ),
        "tests/sweep/test_ledger.py::test_a_checksum_is_of_the_key_and_the_row",
    ),
    Mutant(
        "the improvement interval lacks sqrt(n / (n - 1)), by hand",
        "posefit/statistics/improvement.py",
        (("np.sqrt(seeds / (seeds - 1)) * ", ""),),
        "tests/statistics/test_improvement.py::test_the_interval_of_three_seeds_by_going_through_all_27_resamples",
    ),
    Mutant(
        "the improvement interval lacks sqrt(n / (n - 1)), by 1000 studies",
        "posefit/statistics/improvement.py",
        (("np.sqrt(seeds / (seeds - 1)) * ", ""),),
        "tests/statistics/test_improvement.py::test_intervals_hold_the_truth_in_93_to_98_percent_of_1000_studies[3]",
    ),
    Mutant(
        "Qualisys' k3 stands before the tangential numbers",
        "posefit/geometry/calibration.py",
        (
            ('"radialDistortion2", "tangentalDistortion1"', '"radialDistortion2", "radialDistortion3"'),
            ('"tangentalDistortion2")\n', '"tangentalDistortion1")\n'),
            ('(*names, "radialDistortion3")', '(*names, "tangentalDistortion2")'),
        ),
        "tests/geometry/test_calibration.py::test_qualisys_third_radial_number_is_opencvs_fifth",
    ),
    Mutant(
        "the kernel's radii ignore fy",
        "posefit/silhouette/rasteriser.py",
        (("math.sqrt(view.focal[0] * view.focal[1])", "view.focal[0]"),),
        "tests/silhouette/test_kernels.py::test_radii_are_seen_at_the_mean_of_two_focal_lengths",
    ),
    Mutant(
        "the slow twin's radii ignore fy",
        "tests/silhouette/twin.py",
        (("np.sqrt(camera.focal[0] * camera.focal[1])", "camera.focal[0]"),),
        "tests/silhouette/test_kernels.py::test_a_camera_with_two_focal_lengths_equals_the_twin",
    ),
    Mutant(
        "the OpenCV twin's radii ignore fy",
        "plugins/posefit_reproduce/bench/kernel.py",
        (("np.sqrt(camera.focal.prod())", "camera.focal[0]"),),
        "tests/experiments/test_bench.py::test_opencv_finds_the_same_costs_whatever_the_two_focal_lengths",
    ),
    Mutant(
        "a smaller picture looks along the corners of blocks, not along its pixels' centres",
        "posefit/silhouette/pyramid.py",
        (("(camera.centre - first - 0.5) / factor + 0.5", "camera.centre / factor"),),
        "tests/silhouette/test_pyramid.py::test_a_body_seen_small_is_the_body_drawn_at_full_size_and_looked_at_there",
    ),
    Mutant(
        "a smaller silhouette is aligned to its own borders",
        "posefit/silhouette/pyramid.py",
        (('vars(coarse)["extent"]', 'vars(coarse)["other"]'),),
        "tests/fitting/test_many.py::test_a_proposal_means_the_same_pose_at_every_size[aligned]",
    ),
    Mutant(
        "a limb stays where another combination has another one",
        "posefit/silhouette/several.py",
        (("take_away(image[a:b], added[k, a:b])", "pass"),),
        "tests/silhouette/test_limbs.py::test_any_combinations_in_any_order_do_so_too",
    ),
    Mutant(
        "poses that another thread draws are counted for nobody",
        "posefit/silhouette/sharing.py",
        (("submit(copy_context().run, take_turns)", "submit(take_turns)"),),
        "tests/silhouette/test_sharing.py::test_poses_that_other_threads_draw_are_counted_for_the_one_who_asked",
    ),
    Mutant(
        "who was only seen small may cost less than who was seen whole",
        "posefit/fitting/problem.py",
        (("np.fmax(self._costs, np.fmax.reduce(costs))", "self._costs.copy()"),),
        "tests/fitting/test_many.py::test_only_the_best_of_a_small_look_go_on_and_the_others_cost_no_less",
    ),
    Mutant(
        "the upper reach of `loose` is taken from the least training angle",
        "plugins/posefit_priors/loose.py",
        (("self.angles_high - most[self.loose]", "self.angles_high - least[self.loose]"),),
        "tests/plugins/test_priors.py::test_a_loose_angle_reaches_as_far_as_every_training_pose_may_still_go",
    ),
    Mutant(
        "Track's next box is not centred on what was committed",
        "envs/posefit_envs/track.py",
        (("follower.commit(self._best_proposals[i])", "follower.commit(0.5 * self._best_proposals[i])"),),
        "tests/envs/test_environments.py::test_track_proposals_mean_what_the_tracker_makes_of_them",
    ),
    Mutant(
        "every scene's body is as thick as the first one's",
        "envs/posefit_envs/kernels.py",
        (("draw_pose(own, scenes.radii[i]", "draw_pose(own, scenes.radii[0]"),),
        "tests/envs/test_stage.py::test_scenes_together_are_what_the_library_says_of_each_alone",
    ),
    Mutant(
        "a vector environment hands out the pictures of the step before",
        "envs/posefit_envs/stage.py",
        (("np.empty_like(self._scenes.backdrops) if whole", "self._scenes.backdrops if whole"),),
        "tests/envs/test_vector.py::test_a_vector_environment_equals_single_ones",
    ),
    Mutant(
        "nobody waits for a process that compiles",
        "posefit/arrays/compiling.py",
        (("            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)\n", ""),),
        "tests/arrays/test_compiling.py::test_two_processes_that_start_on_an_empty_cache_compile_each_function_once_in_all",
    ),
    Mutant(
        "the cache looks at a function's own code alone",
        "posefit/arrays/cache.py",
        (("                waiting.append(called)\n", ""),),
        "tests/arrays/test_cache.py::test_a_change_in_a_function_that_is_called_compiles_both_anew",
    ),
    Mutant(
        "a bone's turn moves what hangs on its parent",
        "plugins/posefit_vsmm/kernels.py",
        (("0.5 if _HANGS[joint, j] else 0.0", "0.5 if _HANGS[pivot, j] else 0.0"),),
        "tests/sources/test_vsmm_steps.py::test_the_points_are_projected_and_their_jacobian_is_right",
    ),
    Mutant(
        "of several tracks the one is kept that costs most",
        "posefit/tracking/run.py",
        (("kept = min(range(len(costs))", "kept = max(range(len(costs))"),),
        "tests/tracking/test_tracks.py::test_the_evaluations_of_all_tracks_are_counted[method0]",
    ),
    Mutant(
        "evaluations of tracks that are not kept are not counted",
        "posefit/searching/spent.py",
        (("sum(one.evaluations for one in together)", "frame.evaluations"),),
        "tests/tracking/test_tracks.py::test_the_evaluations_of_all_tracks_are_counted[method0]",
    ),
    Mutant(
        "a whole cost has the motion of frames that were held",
        "posefit/tracking/tracks.py",
        (("changes[followed]", "changes"),),
        "tests/tracking/test_tracks.py::test_frames_that_were_held_count_for_nothing",
    ),
    Mutant(
        "a beginning contradicts where somebody is known to face",
        "posefit/tracking/tracks.py",
        (("name == ANEW or not _contradicts(poses[name], known)", "True"),),
        "tests/tracking/test_tracks.py::test_what_is_known_is_not_contradicted",
    ),
    Mutant(
        "a mirrored body leans the way it leaned",
        "posefit/geometry/alike.py",
        (("exchanged[:, 2] *= -1.0", "exchanged[:, 2] *= 1.0"),),
        "tests/geometry/test_alike.py::test_mirrored_joints_are_those_of_the_other_side_across_the_plane_that_is_faced_along",
    ),
    Mutant(
        "a pose keeps the last step that reaches it, not the cheapest",
        "plugins/posefit_exemplars/kernels.py",
        (("best = min(least[k], limit)", "best = limit"),),
        "tests/exemplars/test_beam.py::test_each_pose_is_reached_by_its_cheapest_step",
    ),
    Mutant(
        "what was seen later weighs nothing",
        "plugins/posefit_exemplars/window.py",
        (("backward = one.kernel @ (backward * one.likelihoods)", "backward = one.kernel @ backward"),),
        "tests/sources/test_exemplars_steps.py::test_what_follows_weighs_a_state_as_all_ways_on_from_it_do",
    ),
    Mutant(
        "a first pose that is given is looked for beyond the budget",
        "plugins/posefit_exemplars/tracker.py",
        (("[: min(most // len(turns), WIDTH)]", "[:WIDTH]"),),
        "tests/exemplars/test_frames.py::test_the_budget_holds_and_small_pictures_count_by_their_pixels",
    ),
    Mutant(
        "the filter leans on the frames before",
        "plugins/posefit_exemplars/smoothing.py",
        (("np.arange(here - reach, here + reach + 1)", "np.arange(here - reach, here + 1)"),),
        "tests/exemplars/test_smoothing.py::test_a_steady_movement_stays_where_it_is_and_every_frame_comes_in_its_order",
    ),
)


def changed(text: str, mutant: Mutant) -> str:
    """Return a file's text with a mutant in it. Raises ValueError where what it replaces is not there just once."""
    for old, new in mutant.changes:
        if (found := text.count(old)) != 1:
            raise ValueError(f"{mutant.path}: expected {old!r} once, found it {found} times: {mutant.what}")
        text = text.replace(old, new)
    return text


def passes(root: Path, tests: Sequence[str], cache: Path) -> bool:
    """Return whether all tests pass, run in a copy of the program. Raises RuntimeError where they could not be run.

    A compiled loop that is in the cache keeps what it called in other files when it was compiled, so a mutant needs a
    cache of its own.
    """
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(str(root / path) for path in PATHS),
        "PYTHONDONTWRITEBYTECODE": "1",  # a mutant of the same length and second would be taken from the bytecode
        "NUMBA_CACHE_DIR": str(cache),
    }
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "--all",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-o",
        "addopts=",
    ]
    words += ["--import-mode=importlib", *tests]
    ran = subprocess.run(words, cwd=root, env=environment, capture_output=True, text=True)
    if ran.returncode > 1 or "skipped" in ran.stdout.splitlines()[-1]:
        raise RuntimeError(f"expected tests that pass or fail, got\n{ran.stdout}{ran.stderr}")
    return ran.returncode == 0


def tried(mutants: Sequence[Mutant], folder: Path) -> int:
    """Return how many of some mutants live, each put into a copy of the program in a folder; prints of each whether.

    Raises ValueError where a test fails without a mutant.
    """
    root, clean = folder / "copy", folder / "cache"
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, root / name)
    if not passes(root, [mutant.test for mutant in mutants], clean):
        raise ValueError("expected the tests to pass without a mutant, but one fails")
    lived = 0
    for mutant in mutants:
        file = root / mutant.path
        text = file.read_text("utf-8")
        file.write_text(changed(text, mutant), "utf-8")
        compiled = "@jit" in text
        killed = not passes(root, [mutant.test], folder / "its own" if compiled else clean)
        file.write_text(text, "utf-8")
        lived += not killed
        print(f"{'killed' if killed else 'LIVES '}  {mutant.what}\n        {mutant.test}", flush=True)
    return lived


def main(words: Sequence[str]) -> int:
    """Try the mutants, all or those that a word chooses, one a core at a time; return the exit status."""
    chosen = [mutant for mutant in MUTANTS if not words or any(word in mutant.what for word in words)]
    try:
        for mutant in chosen:
            changed((ROOT / mutant.path).read_text("utf-8"), mutant)
        workers = max(min(os.cpu_count() or 1, MOST_COPIES, len(chosen)), 1)
        with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
            folders = (Path(folder) / str(k) for k in range(workers))
            lived = sum(pool.map(tried, (chosen[k::workers] for k in range(workers)), folders))
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{len(chosen) - lived} of {len(chosen)} mutants killed")
    return int(lived > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
