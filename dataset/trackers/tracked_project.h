#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

/// Whole folders of programs that track and triangulate: which files of theirs belong together.
namespace mvstudio::dataset {

/// What a project asks of a triangulation, where it says it.
struct ProjectSettings {
  std::string skeleton;  ///< Pose2Sim: of pose.pose_model
  std::string frames;    ///< Pose2Sim: of project.frame_range, "10-299"
  std::string filter;    ///< Pose2Sim: as markers::ParseFilter has it; a gaussian in frames: "gaussian-frames:2"
  std::optional<double> frame_rate_hz, min_score;
  std::optional<int> min_views, fill_frames;
  struct Axis {
    char axis = 'x';
    std::string from, to;
  };
  std::vector<Axis> axes;       ///< anipose: two, or none
  std::string reference_point;  ///< anipose: the origin; empty: none
  struct HingeAngle {
    std::string name, joints[3];  ///< at the second one
  };
  std::vector<HingeAngle> angles;  ///< anipose: [angles]
};

struct TrackedProject {
  struct CameraFile {
    std::string camera, path;
  };
  struct Take {
    std::string name;               ///< anipose: SESSION/VIDEO; caliscope: RECORDING/TRACKER
    std::string calibration;        ///< path
    std::vector<CameraFile> files;  ///< anipose: one 2D file per camera
    std::string table;              ///< caliscope: one table of all cameras
    bool filtered = false;          ///< anipose: the files are those of pose-2d-filtered
  };
  std::string program;  ///< "anipose", "caliscope", "Pose2Sim"
  ProjectSettings settings;
  std::vector<std::string> notes;                          ///< how settings were understood, in sentences
  std::vector<Take> takes;                                 ///< by name
  std::vector<std::pair<std::string, std::string>> bones;  ///< anipose: between joints, by names, in config.toml
  double board_square = 0;            ///< side of the board's squares as config.toml states it; 0: not stated
  std::vector<std::string> unused;    ///< keys of its configuration that change its results and are not used here
  std::vector<std::string> left_out;  ///< files whose name tells no camera, and takes of one camera: "PATH: why"
};

/// anipose: config.toml with `nesting` levels of session folders, each with pose-2d-filtered (if config.toml enables the
/// filter) or pose-2d, whose files name their camera as triangulation.cam_regex says; calibration.toml lies in the session's
/// calibration folder or in that of a folder above. Bones are triangulation.constraints, else the lines of labeling.scheme
/// (anipose/triangulate.py, anipose/common.py; docs/sphinx/start3d.rst).
/// caliscope: recordings/NAME/TRACKER/xy_TRACKER.csv with the camera_array.toml beside it, else the project's
/// (docs/reconstruction.md of its project, "Per-Recording Camera Snapshot").
/// Pose2Sim: Config.toml of the folder or of one up to three above it, which fill in what it lacks; its trials are the folder
/// itself or folders in it that have pose-associated, pose-sync or pose (the first that is there), with a folder of JSON files
/// for each camera. Calibration is the .toml in the nearest folder called calib…; cameras go by their names, else by their
/// order. Throws IoError for a folder that cannot be read; FormatError for a folder of neither kind, one without takes, a
/// config.toml that cannot be read, and for cropped videos (config.toml: cameras.NAME.offset), which would need shifting.
TrackedProject ReadTrackedProject(const std::string& folder);

/// The take of that name; without a name the only one. Throws UsageError that lists the names.
const TrackedProject::Take& FindTake(const TrackedProject& project, const std::string& name);

}  // namespace mvstudio::dataset
