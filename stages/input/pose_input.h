#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/join.h"
#include "dataset/pose/score_scale.h"
#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/input/pose_changes.h"
#include "stages/input_notes.h"
#include "stages/words.h"
#include "triangulate/take/take.h"

/// A calibration and its cameras' 2D joints of people: the input of every command that works on 2D joints.
namespace mvstudio::stages {

inline constexpr char kInvertHelp[] =
    "the file gives poses the other way round (world from camera for camera from world): invert them";
inline constexpr char kMirrorHelp[] =
    "the file is left-handed (x right, y up, z forward, of world and cameras): turn y over in both";

struct PoseArguments {
  std::string calib;
  std::string calib_unit;               ///< of a calibration that names none: m, cm, mm, in; empty: m
  bool invert = false, mirror = false;  ///< of the calibration's poses, see CalibReadOptions
  std::string skeleton;  ///< name or file; empty: pose2d's skeleton.json beside the folders, else body25; or the joints named
                         ///< in the table of points, DeepLabCut's or SLEAP's files
  std::string points2d;  ///< table of points of all cameras, ours or caliscope's, instead of pose2d
  std::vector<std::pair<std::string, std::string>> bones = {};  ///< of a project's configuration, for files that state none
  bool lenses_suffice = false;  ///< cameras without poses are taken (geometry::kLensesOnly); else they are refused
  std::vector<std::string> without_joints = {};  ///< names of joints whose detections are left out
  PoseChanges changes = {};
  std::vector<NamedPath> pose2d;  ///< folders of OpenPose JSON files, or files, DeepLabCut's and SLEAP's too, one per camera
  std::vector<NamedPath> footage = {};  ///< videos and images of the same frames, where they are known: no options of their own
};

/// What triangulate and sync take; the other fields are filled from projects and by other commands.
template <class Visitor>
void VisitFields(Visitor&& visit, PoseArguments& o) {
  StartGroup(visit, "Calibration and 2D joints");
  visit("calib", o.calib, "calibration file: ours, Panoptic's, or any that calib convert reads");
  visit("pose2d", o.pose2d,
        "NAME=FOLDER of OpenPose JSON files or YOLO-pose labels, or NAME=FILE with the results of a whole video: COCO, "
        "AlphaPose, MMPose, "
        "DeepLabCut (.h5, .csv), SLEAP (analysis .h5, .csv), NumPy (.npy, .npz); repeat for each camera");
  visit("points2d", o.points2d,
        "instead: table camera,frame,person,joint,x_px,y_px,score (CSV) of all cameras, for markers and animals, or "
        "caliscope's xy_TRACKER.csv");
  visit("skeleton", o.skeleton,
        Join(geometry::SkeletonNames(), " | ") +
            ", or a file FILE.toml of your own (docs/formats.md); body25 unless given, of option 'points2d', DeepLabCut and "
            "SLEAP "
            "the joints in the file");
  VisitStyled(visit, OptionStyle::kList, "without-joint", o.without_joints,
              "names of joints, with commas, whose detections are left out");
  visit("unit,calib-unit", o.calib_unit, "m, cm, mm or in: of a calibration that names no unit; m unless given");
  VisitStyled(visit, OptionStyle::kSwitch, "invert", o.invert, kInvertHelp);
  VisitStyled(visit, OptionStyle::kSwitch, "mirror", o.mirror, kMirrorHelp);
  VisitFields(visit, o.changes);
}

struct PoseInput {
  geometry::Rig rig;
  geometry::Skeleton skeleton;
  std::vector<std::pair<int, int>> limbs;          ///< LimbsOf the skeleton
  std::vector<std::string> cameras;                ///< cameras with data, by name
  std::vector<dataset::Pose2dTrack> tracks;        ///< one per camera
  std::vector<triangulate::DetectedFrame> frames;  ///< every frame that any camera has, ascending
};

/// Bones whose lengths are measured: of people, and of joints without bones, the upper arms, forearms, thighs and shanks by
/// their names; of any other skeleton all.
std::vector<std::pair<int, int>> LimbsOf(const geometry::Skeleton& skeleton);

/// The properties of the skeleton that triangulation uses.
triangulate::TakeBody BodyOf(const geometry::Skeleton& skeleton);

/// Reads everything; the files become inputs of `result`. Unreadable parts are listed in its warnings and make it partial
/// (exit 6). Throws UsageError for fewer than two cameras or one given twice.
PoseInput ReadPoseInput(const PoseArguments& arguments, InputNotes* notes);

/// Same in parts, for takes larger than memory. Folders of OpenPose files are read as needed; of data in a single file the
/// tracks are held, 24 bytes for each joint of each image.
class PoseParts {
 public:
  PoseParts(const PoseArguments& arguments, InputNotes* notes);

  /// Without tracks and frames.
  const PoseInput& input() const { return input_; }
  size_t num_frames() const { return numbers_.size(); }
  /// The frames with indices [begin, end) of the take. Lists unreadable files; throws FormatError once they are more than
  /// half of a camera's files.
  std::vector<triangulate::DetectedFrame> Read(size_t begin, size_t end, InputNotes* notes) const;

 private:
  PoseArguments arguments_;
  PoseInput input_;
  std::vector<dataset::Pose2dTrack> tracks_;                      ///< all of them, if they came in one file
  std::vector<int> numbers_;                                      ///< of all frames, ascending
  std::map<std::string, dataset::ScoreScale> scales_;             ///< of folders that are read as needed
  std::map<std::string, dataset::OpenPoseFolder> folders_;        ///< by camera
  mutable std::map<std::string, std::set<std::string>> damaged_;  ///< lines about files, by camera
};

}  // namespace mvstudio::stages
