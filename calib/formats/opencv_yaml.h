// Private: for opencv.cc, easymocap.cc and formats.cc.
#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "calib/formats/document.h"
#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"

/// OpenCV's FileStorage: YAML 1.0 and XML.
namespace mvstudio::calib::internal {

/// A top-level entry of a FileStorage file.
struct Entry {
  Value value;
  Place place;
};
using Entries = std::map<std::string, Entry>;

/// The entries of OpenCV's XML storage, as its YAML would give them. Throws FormatError.
Value ParseOpenCvXml(const std::string& path, const std::string& text);

/// Keys as written or, if `normalised`, in lower case without underscores, because OpenCV's own samples write
/// camera_matrix, Camera_Matrix and cameraMatrix. Adds to `entries`; throws FormatError for a key that is already there.
void ReadEntries(const std::string& path, bool normalised, Entries* entries);

/// A key in lower case without underscores.
std::string NormalisedKey(const std::string& key);

/// A camera whose entries are a table of their own.
struct NestedCamera {
  std::string name;   ///< as the table says, else its key, in a list with its number
  std::string where;  ///< the table's path
  Entries entries;    ///< normalised; their places are paths, `cameras[0].K`
};
/// Cameras in tables of the root, one with a matrix under one of `matrix_keys` each: `cam0: {K: …}`, in a table of cameras, or
/// in a list; matrix and pose may stand in tables `intrinsics` and `extrinsics` of it. What holds them counts as used. Throws
/// FormatError for another table or list beside them, where they are not at the root.
std::vector<NestedCamera> FindNestedCameras(const Entries& root, std::initializer_list<const char*> matrix_keys);
/// Cameras whose keys bear their numbers, `camera_matrix_0`, `R_0`, … or `cam0_K`: three or more, or two with a pose each (two
/// without are a stereo pair); empty: none. What holds them counts as used.
std::vector<NestedCamera> NumberedCameras(const Entries& root, std::initializer_list<const char*> matrix_keys);
/// The paths of all matrices with rows, cols and data.
std::vector<std::string> MatrixPaths(const Entries& root);

/// Whether a text is a message of ROS's camera_info as `topic echo` prints it: distortion_model, k and d.
bool IsCameraInfo(std::string_view text);

/// Whether it is JSON of cameras with OpenCV's matrices: camera_matrix, cameraMatrix, mtx, or K with dist or D.
bool IsJsonOfMatrices(std::string_view text);

const Entry* FindEntry(const Entries& entries, const std::string& key);
/// The first of several names of the same thing.
const Entry* FindFirst(const Entries& entries, std::initializer_list<const char*> keys);

/// What the entries say about their lens.
geometry::LensWords LensWordsOf(const Entries& entries);
/// The entries that nobody looked for; `harmless` as in AddUnused.
void AddUnusedEntries(const Entries& entries, std::initializer_list<const char*> harmless, geometry::UnusedKeys* unused);

double ReadNumber(const Entry& entry);
Eigen::MatrixXd ReadMatrix(const Entry& entry);
Eigen::Matrix3d ReadMatrix3(const Entry& entry);
Eigen::VectorXd ReadVector(const Entry& entry);
/// Distortion coefficients without the zeros that OpenCV writes for its thin-prism and tilt terms; empty without an entry.
Eigen::VectorXd ReadDistortion(const Entry* entry);
/// A Rodrigues vector or a 3x3 matrix.
Eigen::Quaterniond ReadRotation(const Entry& entry);

/// `key: !!opencv-matrix …`.
std::string MatrixEntry(const std::string& key, const Eigen::MatrixXd& matrix);

}  // namespace mvstudio::calib::internal
