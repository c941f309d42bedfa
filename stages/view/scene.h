#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "dataset/time/timeline.h"
#include "geometry/rig/rig.h"
#include "stages/input_notes.h"
#include "stages/view/options.h"

/// What there is to look at: cameras, their footage, and the joints of each time step.
namespace mvstudio::stages {

struct SceneCamera {
  std::string name;
  int rig_idx = -1;         ///< -1: its lens is not known
  std::string footage;      ///< as dataset::OpenFrames takes it; empty: none
  std::string mask_folder;  ///< of its masks, by frame number; empty: none
};

struct Scene {
  std::string kind;   ///< "session", "dataset", "run", "calibration", "points", "footage", "messages"
  std::string title;  ///< name of what is shown
  std::string root;   ///< the folder that files may lie in; empty: anywhere
  geometry::Rig rig;
  std::vector<SceneCamera> cameras;
  std::shared_ptr<const dataset::Timeline> timeline;         ///< none: frame n shows time step n
  geometry::Skeleton skeleton;                               ///< of the 3D joints
  std::map<int, std::map<int, dataset::JointsPose>> joints;  ///< time step -> person -> 3D joints, in world
  std::map<int, double> error_px;                            ///< time step -> median rms of its joints, px
  geometry::Skeleton detected_skeleton;                      ///< of the 2D joints
  std::map<std::string, dataset::Pose2dTrack> detections;    ///< camera -> 2D joints by frame number
  std::vector<int> steps;                                    ///< ascending
  std::map<int, std::map<std::string, double>> held_out;     ///< time step -> camera -> SSIM (NaN: none) of an avatar's score
  std::map<int, std::map<std::string, std::string>> scored;  ///< time step -> camera -> what `avatar eval` drew of that: a file
  double fps_hz = 0;                                         ///< 0: not known
  std::string report_folder;                                 ///< with results for a report; empty: none
};

/// Reads all but the images. Of points alone, three cameras are made that look from the front, the side and above. Throws
/// UsageError, IoError, FormatError.
Scene ReadScene(const ViewSceneOptions& options, InputNotes* notes);

/// Pixels of a person's joints; NaN where there is none.
using JointsPx = std::vector<Eigen::Vector2d>;

/// One camera at one time step.
struct SceneView {
  int64_t frame = -1;                                                  ///< number in the footage; -1: none
  std::map<int, JointsPx> projected;                                   ///< person -> 3D joints through the lens
  std::vector<JointsPx> detected;                                      ///< by the detector's order
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> residuals;  ///< from the projection to what was observed
};
SceneView ViewAt(const Scene& scene, size_t camera_idx, int step);

/// The camera's frame at a time step; -1: none.
int64_t FrameAt(const Scene& scene, size_t camera_idx, int step);

/// Median length of the residuals, px; NaN without any.
double MedianResidualPx(const SceneView& view);

}  // namespace mvstudio::stages
