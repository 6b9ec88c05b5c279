"""Instruments: what is read of a machine at its poses, a class for each kind of reading."""

from pkmcal.readings.alignment import Sighting as Sighting
from pkmcal.readings.alignment import frame_of_points as frame_of_points
from pkmcal.readings.alignment import frame_of_poses as frame_of_poses
from pkmcal.readings.angles import Angle as Angle
from pkmcal.readings.boards import Board as Board
from pkmcal.readings.camera import Camera as Camera
from pkmcal.readings.closure import Closure as Closure
from pkmcal.readings.dependences import always as always
from pkmcal.readings.dependences import point as point
from pkmcal.readings.distances import Between as Between
from pkmcal.readings.distances import Distance as Distance
from pkmcal.readings.distances import RelativeDistance as RelativeDistance
from pkmcal.readings.points import Height as Height
from pkmcal.readings.points import Position as Position
from pkmcal.readings.predicted import At as At
from pkmcal.readings.predicted import Predicted as Predicted
from pkmcal.readings.reading import Reading as Reading
from pkmcal.readings.touches import Touch as Touch
from pkmcal.readings.touches import TouchDistance as TouchDistance
from pkmcal.readings.turnings import Orientation as Orientation
from pkmcal.readings.turnings import Pose as Pose
from pkmcal.readings.turnings import Tilt as Tilt
from pkmcal.readings.unknowns import Dependence as Dependence
from pkmcal.readings.unknowns import Nature as Nature
from pkmcal.readings.unknowns import Start as Start
