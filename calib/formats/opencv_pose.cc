#include <algorithm>
#include <string_view>

#include "calib/formats/format_camera.h"
#include "calib/formats/opencv_keys.h"
#include "core/error.h"

/// Where a camera stands, in OpenCV's files and in JSON of cameras with OpenCV's matrices.
namespace mvstudio::calib::internal {
namespace {

/// Names of one matrix [R t], 3x4 or 4x4, and which way it goes; camera axes are OpenCV's.
constexpr std::initializer_list<const char*> kCamFromWorldKeys = {
    "w2c",       "worldtocam",   "worldtocamera", "world2cam",       "world2camera", "camfromworld", "camerafromworld",
    "tcamworld", "tcameraworld", "tcw",           "extrinsicmatrix", "extrinsics",   "extrinsic"};
constexpr std::initializer_list<const char*> kWorldFromCamKeys = {
    "c2w",       "camtoworld",   "cameratoworld", "cam2world", "camera2world", "worldfromcam", "worldfromcamera",
    "tworldcam", "tworldcamera", "twc",           "tsc"};

/// A 4x4 matrix ends in 0, 0, 0, 1; one of columns for rows has these at the right.
void CheckLastRow(const Eigen::MatrixXd& matrix, const Place& place) {
  constexpr double kRounding = 1e-6;
  const Eigen::RowVector4d last(0, 0, 0, 1);
  if (matrix.rows() < 4 || (matrix.row(3) - last).cwiseAbs().maxCoeff() <= kRounding) return;
  const bool transposed = (matrix.col(3).transpose() - last).cwiseAbs().maxCoeff() <= kRounding;
  throw FormatError(place.path, place.where,
                    transposed ? "seems to be transposed: its last column is 0, 0, 0, 1, and its last row must be; write its "
                                 "columns as rows"
                               : "the last row of a matrix [R t] must be 0, 0, 0, 1");
}

geometry::Rigid3 ReadPoseMatrix(const Entry& entry, double metres_per_unit) {
  Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.cols() == 1 && (matrix.size() == 12 || matrix.size() == 16))
    matrix = matrix.reshaped(4, matrix.size() / 4).transpose().eval();
  if (matrix.cols() != 4 || (matrix.rows() != 3 && matrix.rows() != 4))
    throw FormatError(entry.place.path, entry.place.where, "a 3x4 or 4x4 matrix [R t] was expected");
  CheckLastRow(matrix, entry.place);
  return {MakeRotation(matrix.topLeftCorner<3, 3>(), entry.place), matrix.topRightCorner<3, 1>() * metres_per_unit};
}

/// aniposelib's words as JSON (AIST++): a rotation vector, where others write three angles by this name.
bool IsAnipose(const Entries& entries) { return entries.count("matrix") && entries.count("distortions"); }

/// How many numbers a list, a list of rows or a stored matrix holds; 0 where it holds anything else.
size_t CountNumbers(const Value& value) {
  if (value.kind == Value::Kind::kNumber) return 1;
  if (value.kind == Value::Kind::kTable) {
    const auto data = std::find_if(value.entries.begin(), value.entries.end(), [](const auto& e) { return e.first == "data"; });
    return data == value.entries.end() ? 0 : CountNumbers(data->second);
  }
  size_t count = 0;
  for (const Value& item : value.items) {
    const size_t own = CountNumbers(item);
    if (own == 0) return 0;
    count += own;
  }
  return count;
}

bool IsPoseMatrix(const Value& value) {
  const size_t count = CountNumbers(value);
  return count == 12 || count == 16;
}

/// The first of several names that holds a matrix [R t]; views of a board (a list of poses) are none.
const Entry* FindPoseMatrix(const Entries& entries, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    const auto found = entries.find(key);
    if (found != entries.end() && IsPoseMatrix(found->second.value)) return FindEntry(entries, key);
  }
  return nullptr;
}

/// Whether a key that was not read names where the camera stands: as many numbers as an angle each, a quaternion, a centre or a
/// matrix have.
bool NamesPose(const std::string& key, const Value& value) {
  const std::initializer_list<const char*> kPieces = {"pose",     "quat",   "qvec",      "position", "campos", "camrot",
                                                      "rotation", "transl", "tvec",      "rvec",     "euler",  "camerac",
                                                      "tworld",   "centre", "extrinsic", "rtvec",    "lookat", "transform"};
  const std::initializer_list<const char*> kWhole = {"q", "c", "r", "t", "rot", "trans", "pos", "center", "rt", "orientation"};
  const size_t count = CountNumbers(value);
  const bool fits = count == 3 || count == 4 || count == 6 || count == 7 || count == 9 || count == 12 || count == 16;
  return fits &&
         (std::any_of(kWhole.begin(), kWhole.end(), [&](const char* word) { return key == word; }) ||
          std::any_of(kPieces.begin(), kPieces.end(), [&](const char* piece) { return key.find(piece) != std::string::npos; }));
}

/// What by its name may be a pose and is none: OpenCV's views of the board and its Q (4x4) of disparities, and the R by which
/// ROS rectifies, beside its distortion_model or its P = K [I t].
bool IsNoPose(const Entries& entries, const std::string& key, const Value& value) {
  if (key == "extrinsicparameters") return true;
  if (key == "q") return CountNumbers(value) == 16;
  if (key != "r") return false;
  const auto projection = entries.find("p");
  if (entries.count("distortionmodel") || projection == entries.end()) return entries.count("distortionmodel") > 0;
  if (CountNumbers(projection->second.value) != 12) return false;
  Eigen::MatrixXd p = ReadMatrix(projection->second);
  if (p.cols() == 1) p = p.reshaped(4, 3).transpose().eval();
  return p.rows() == 3 && p(1, 0) == 0 && p(2, 0) == 0 && p(2, 1) == 0;
}

}  // namespace

bool IsJarvis(const Entries& entries) {
  const auto matrix = entries.find("intrinsicmatrix");
  if (matrix == entries.end()) return false;
  const Eigen::MatrixXd k = ReadMatrix(matrix->second);
  return k.rows() == 3 && k.cols() == 3 && k.topRightCorner(2, 1).isZero(0) && !k.bottomLeftCorner(1, 2).isZero(0);
}

bool IsOpenPose(const Entries& entries) {
  const auto matrix = entries.find("cameramatrix");
  return entries.count("intrinsics") && matrix != entries.end() && ReadMatrix(matrix->second).cols() == 4;
}

geometry::Rigid3 ReadPose(const Entry& rotation, const Entry& translation, double metres_per_unit) {
  geometry::Rigid3 pose;
  pose.rotation = ReadRotation(rotation);
  const Eigen::VectorXd t = ReadVector(translation);
  if (t.size() != 3) throw FormatError(translation.place.path, translation.place.where, "3 numbers were expected");
  pose.translation = t * metres_per_unit;
  return pose;
}

std::optional<geometry::Rigid3> FindPose(const Entries& entries, double metres_per_unit) {
  constexpr std::pair<const char*, const char*> kPairs[] = {
      {"r", "t"},      {"rvec", "tvec"}, {"r", "tvec"}, {"rotationmatrix", "translationvector"}, {"rotation", "translation"},
      {"rot", "trans"}};
  for (const auto& [turn, shift] : kPairs) {
    if (!entries.count(turn) || !entries.count(shift)) continue;
    const bool three = ReadMatrix(entries.at(turn)).size() == 3;
    if (three && std::string_view(turn).substr(0, 3) == "rot" && !IsAnipose(entries)) continue;  // angles, of whatever kind
    geometry::Rigid3 pose = ReadPose(*FindEntry(entries, turn), *FindEntry(entries, shift), metres_per_unit);
    if (IsJarvis(entries)) pose.rotation = pose.rotation.inverse();
    return pose;
  }
  if (IsOpenPose(entries)) {
    const Entry& both = *FindEntry(entries, "cameramatrix");
    if (ReadMatrix(both).rows() != 3) throw FormatError(both.place.path, both.place.where, "a 3x4 matrix [R t] was expected");
    return ReadPoseMatrix(both, metres_per_unit);
  }
  if (const Entry* const matrix = FindPoseMatrix(entries, kCamFromWorldKeys)) return ReadPoseMatrix(*matrix, metres_per_unit);
  if (const Entry* const matrix = FindPoseMatrix(entries, kWorldFromCamKeys))
    return Inverse(ReadPoseMatrix(*matrix, metres_per_unit));
  return std::nullopt;
}

void RefuseOtherPoses(const std::vector<Entries>& cameras) {
  for (const Entries& entries : cameras) {
    for (const auto& [key, entry] : entries) {
      if (entry.value.used || !NamesPose(key, entry.value) || IsNoPose(entries, key, entry.value)) continue;
      throw FormatError(
          entry.place.path, entry.place.where,
          "seems to say where the camera stands, in a way that this reader does not know: write R (3x3) and T, "
          "x_camera = R x_world + T (of a camera's centre c, T = -R c), or take the key out to read the lenses alone");
    }
  }
}

}  // namespace mvstudio::calib::internal
