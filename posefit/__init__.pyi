"""The names of `posefit`, each with the module that defines it."""

from pluggy import HookimplMarker

from posefit.comparison import Comparison as Comparison
from posefit.comparison import compare as compare
from posefit.fitting.box import Space as Space
from posefit.fitting.box import Start as Start
from posefit.fitting.cost import SilhouetteCost as SilhouetteCost
from posefit.fitting.optimiser import Filter as Filter
from posefit.fitting.optimiser import Optimiser as Optimiser
from posefit.fitting.prior import Prior as Prior
from posefit.fitting.problem import BudgetSpentError as BudgetSpentError
from posefit.fitting.problem import Problem as Problem
from posefit.fitting.problem import Problems as Problems
from posefit.fitting.problem import minimise as minimise
from posefit.fitting.space import SearchSpace as SearchSpace
from posefit.fitting.synthesis import SynthesisTracker as SynthesisTracker
from posefit.fitting.tracker import Frame as Frame
from posefit.fitting.tracker import Observation as Observation
from posefit.fitting.tracker import Task as Task
from posefit.fitting.tracker import Tracker as Tracker
from posefit.footage.device import moved_to as moved_to
from posefit.footage.extraction import Extraction as Extraction
from posefit.geometry.body import Body as Body
from posefit.geometry.camera import Camera as Camera
from posefit.geometry.skeleton import JOINTS as JOINTS
from posefit.geometry.skeleton import Skeleton as Skeleton
from posefit.geometry.symmetry import exchanged_limbs as exchanged_limbs
from posefit.geometry.symmetry import facing as facing
from posefit.geometry.symmetry import mirrored_poses as mirrored_poses
from posefit.geometry.symmetry import reflected_poses as reflected_poses
from posefit.geometry.symmetry import turned_poses as turned_poses
from posefit.measuring.angles import clinical_angles as clinical_angles
from posefit.measuring.centres import joint_centres as joint_centres
from posefit.measuring.gait import gait_of as gait_of
from posefit.motion.clips import load_motion as load_motion
from posefit.motion.motion import Motion as Motion
from posefit.registry import optimiser as optimiser
from posefit.registry import prior as prior
from posefit.silhouette.cost import areas as areas
from posefit.silhouette.cost import mismatch as mismatch
from posefit.silhouette.cost import pose_costs as pose_costs
from posefit.silhouette.cost import project as project
from posefit.silhouette.mask import Silhouette as Silhouette
from posefit.statistics.means import run_means as run_means
from posefit.statistics.paired import paired_tests as paired_tests
from posefit.suites.problem import Suite as Suite
from posefit.suites.problem import suite as suite
from posefit.suites.running import run_of as run_of
from posefit.suites.running import suite_scores as suite_scores
from posefit.sweep.ledger import Ledger as Ledger
from posefit.tracking.front import fit as fit
from posefit.tracking.front import track as track
from posefit.tracking.live import track_live as track_live
from posefit.tracking.result import Fit as Fit
from posefit.tracking.result import Track as Track
from posefit.uncertainty.intervals import angle_intervals as angle_intervals
from posefit.uncertainty.intervals import joint_intervals as joint_intervals
from posefit.uncertainty.modes import modes_of as modes_of
from posefit.version import __version__ as __version__

hookimpl: HookimplMarker
