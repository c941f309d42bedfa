#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

/// The files of CMU Panoptic unchanged: centimetres, y down, names as written, every number the double of the file.
/// Unknown keys are kept and written back, so that reading, writing and reading again gives equal values and the same
/// keys. Meaning and layout: docs/formats.md. Every Parse and Read function throws FormatError with the path and the
/// place.
namespace mvstudio::dataset {

/// Keys beyond those named here, with their JSON text.
using PanopticExtras = std::vector<std::pair<std::string, std::string>>;

/// One entry of "cameras" in calibration_<seq>.json: x_in_cam = cam_from_world_rotation x_in_world + cam_from_world_cm.
struct PanopticCamera {
  std::string name;                               ///< `%02d_%02d`: panel, node
  std::optional<std::string> type;                ///< "hd", "vga", "kinect-color"
  int width_px = 0, height_px = 0;                ///< "resolution"
  std::optional<int> panel, node;                 ///< hd 0, 0..30; vga 1..20, 1..24; kinect-color 50, 1..10
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();    ///< [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], px
  std::array<double, 5> distortion{};             ///< "distCoef": k1, k2, p1, p2, k3, OpenCV's order
  Eigen::Matrix3d cam_from_world_rotation;        ///< "R", with the ten decimals of the file
  Eigen::Vector3d cam_from_world_translation_cm;  ///< "t"
  PanopticExtras extras;
};

struct PanopticCalibrationFile {
  std::optional<std::string> source;  ///< "calibDataSource"
  std::vector<PanopticCamera> cameras;
  PanopticExtras extras;
};

PanopticCalibrationFile ParsePanopticCalibration(std::string_view text, const std::string& path);
PanopticCalibrationFile ReadPanopticCalibrationFile(const std::string& path);
/// Keys that are kept and not used. Throws FormatError for one that says that the numbers mean something else
/// (geometry/rig/file_keys.h); so does ToRig.
std::string UnusedKeysOf(const PanopticCalibrationFile& file, const std::string& path);

/// A camera whose panel and node are not those of its name.
struct PanopticNameConflict {
  size_t camera = 0;  ///< index
  std::string text;   ///< what disagrees, and what counts
  /// They are those of another camera of the file: programs that go by the numbers, as CMU's, take one camera for the other.
  /// The readers of rigs refuse that. Else the name counts, because footage bears it.
  bool exchanged = false;
};
std::vector<PanopticNameConflict> PanopticNameConflicts(const std::vector<PanopticCamera>& cameras);
std::string ToText(const PanopticCalibrationFile& file);
void WritePanopticCalibrationFile(const PanopticCalibrationFile& file, const std::string& path);

/// Converts to our world and lens models. Errors name `path`: not a rotation, skew, a repeated name, or one that is not a
/// valid folder name.
geometry::Rig ToRig(const PanopticCalibrationFile& file, const std::string& path);
/// Throws like WritePanopticCalibration.
PanopticCalibrationFile ToPanopticCalibration(const geometry::Rig& rig, const std::string& source);

/// One of "bodies". Each joint is x, y, z (cm) and confidence; a missing joint is 0, 0, 0, -1.
struct PanopticBody {
  int id = 0;                    ///< below 0: a false positive of CMU's tracker
  std::vector<double> joints19;  // (19 x 4) coco19; empty where the file has another skeleton
  std::vector<double> joints26;  // (26 x 4)
  std::vector<double> joints15;  // (15 x 4) mpi15, of old sequences
  int num_without_numbers = 0;   ///< joints that the file gives a null or NaN; they are missing (c = -1)
  PanopticExtras extras;
};

/// body3DScene_%08d.json.
struct PanopticScene {
  std::optional<double> version;            ///< 0.6 has confidence, 0.7 ids
  std::optional<double> univ_time_ms;       ///< the studio's universal clock; -1 when unknown
  std::optional<std::string> fps_type;      ///< "hd_29_97" or "vga_25"
  std::optional<double> vga_video_time_ms;  ///< univ_time since frame 0; CMU writes it for vga_25 only
  std::vector<PanopticBody> bodies;
  PanopticExtras extras;
};

PanopticScene ParsePanopticScene(std::string_view text, const std::string& path);
PanopticScene ReadPanopticScene(const std::string& path);
/// Writes the bytes of CMU's writer, with more than its six digits where a number needs them.
std::string ToText(const PanopticScene& scene);
void WritePanopticScene(const PanopticScene& scene, const std::string& path);

/// People with ids from 0 on that have joints19, in our world. Throws FormatError for a repeated id and for a body with
/// another skeleton only.
std::map<int, Coco19Pose> ToCoco19(const PanopticScene& scene, const std::string& path);
PanopticScene ToPanopticScene(const std::map<int, Coco19Pose>& people, double univ_time_ms);

/// Points of a face (70, OpenPose's face) or a hand (21, OpenPose's hand). They have no separate confidence.
struct PanopticLandmarks {
  std::vector<double> landmarks_cm;                         // (N x 3) x, y, z
  std::optional<std::vector<double>> average_score;         // (N)
  std::optional<std::vector<double>> average_error_px;      // (N) "averageReproError"
  std::optional<std::vector<std::vector<int>>> visibility;  // (N) indices of HD cameras
  PanopticExtras extras;
};

struct PanopticLandmarkPerson {
  int id = 0;                                                      ///< below 0: not valid
  std::optional<PanopticLandmarks> face70, left_hand, right_hand;  ///< a hand may be missing
  PanopticExtras extras;
};

/// faceRecon3D_hd%08d.json and handRecon3D_hd%08d.json.
struct PanopticLandmarkFile {
  std::vector<PanopticLandmarkPerson> people;
  PanopticExtras extras;
};

PanopticLandmarkFile ParsePanopticLandmarks(std::string_view text, const std::string& path);
PanopticLandmarkFile ReadPanopticLandmarks(const std::string& path);
std::string ToText(const PanopticLandmarkFile& file);
void WritePanopticLandmarks(const PanopticLandmarkFile& file, const std::string& path);
/// Mean score; 0 without scores. CMU's toolbox does not draw below 0.001.
double MeanScore(const PanopticLandmarks& landmarks);
/// (3, N) metres in our world.
Eigen::Matrix3Xd InWorld(const PanopticLandmarks& landmarks);

/// One clock of a sync table: the time of each frame.
struct PanopticSyncTrack {
  std::vector<std::string> place;    ///< {"hd"}, {"kinect", "color", "KINECTNODE1"}, …
  std::vector<double> univ_time_ms;  ///< below 0: no frame
  std::optional<std::vector<double>> index;
  PanopticExtras extras;
};

/// synctables_<seq>.json and ksynctables_<seq>.json.
struct PanopticSyncTables {
  std::vector<PanopticSyncTrack> tracks;
  std::vector<std::pair<std::vector<std::string>, std::string>> extras;  ///< everything else, by its place

  /// The track at "hd" or "kinect.depth.KINECTNODE3"; null when there is none.
  const PanopticSyncTrack* Find(const std::string& dotted) const;
};

PanopticSyncTables ParsePanopticSyncTables(std::string_view text, const std::string& path);
PanopticSyncTables ReadPanopticSyncTables(const std::string& path);
std::string ToText(const PanopticSyncTables& tables);

}  // namespace mvstudio::dataset
