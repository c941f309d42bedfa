#include "calib/formats.h"

#include <charconv>
#include <cmath>
#include <filesystem>

#include "calib/formats_internal.h"
#include "core/error.h"
#include "core/files.h"
#include "geometry/rigid3.h"

namespace mvstudio::calib {
namespace {

constexpr std::string_view kNames[] = {"mvstudio", "panoptic", "qualisys", "qca", "opencv"};
constexpr double kMaxSizePx = 1 << 20;

}  // namespace

std::string_view ToString(CalibrationFormat format) { return kNames[static_cast<int>(format)]; }

std::optional<CalibrationFormat> CalibrationFormatFromString(std::string_view name) {
  for (int i = 0; i < 5; ++i) {
    if (kNames[i] == name) return static_cast<CalibrationFormat>(i);
  }
  return std::nullopt;
}

CalibrationFormat DetectFormat(const std::string& path) {
  const std::string text = ReadFile(path);
  const auto has = [&](const char* piece) { return text.find(piece) != std::string::npos; };
  const size_t start = text.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  if (start == std::string::npos) throw FormatError(path, "", "the file is empty");
  if (text.compare(start, 5, "%YAML") == 0) return CalibrationFormat::kOpenCvYaml;
  if (text[start] == '{') return has("mvstudio.calibration") ? CalibrationFormat::kMvstudio : CalibrationFormat::kPanoptic;
  if (text[start] == '<' && has("<calibration")) return CalibrationFormat::kQca;
  if (std::filesystem::path(path).extension() == ".toml" || (has("matrix") && has("distortions"))) {
    return CalibrationFormat::kQualisysToml;
  }
  throw FormatError(
      path, "",
      "not a calibration that is known here; name its format with --from (qualisys, qca, panoptic, opencv, mvstudio)");
}

namespace internal {

std::string Printable(std::string_view text) {
  std::string plain(text.substr(0, 40));
  for (char& c : plain) c = c >= ' ' && c <= '~' ? c : '?';
  return plain;
}

double ParseNumber(std::string_view text, const Place& place) {
  const size_t first = text.find_first_not_of(" \t\r\n+"), last = text.find_last_not_of(" \t\r\n");
  if (first != std::string_view::npos) text = text.substr(first, last + 1 - first);
  double number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (code != std::errc() || end != text.data() + text.size() || !std::isfinite(number)) {
    throw FormatError(place.path, place.where, "'" + Printable(text) + "' is not a finite number");
  }
  return number;
}

Eigen::Quaterniond MakeRotation(const Eigen::Matrix3d& matrix, const Place& place) {
  const double error = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error < 2e-3) || !(matrix.determinant() > 0)) {
    throw FormatError(
        place.path, place.where,
        "not a rotation: |R R^T - I| = " + std::to_string(error) + ", determinant " + std::to_string(matrix.determinant()));
  }
  return geometry::NearestRotation(matrix);
}

geometry::Camera MakeCamera(const std::string& name, double width_px, double height_px, const Eigen::Matrix3d& k,
                            const Eigen::VectorXd& distortion, bool fisheye, const Place& place) {
  using geometry::LensModel;
  const auto fail = [&](const std::string& what) { throw FormatError(place.path, place.where, what); };
  const auto is_size = [](double size) { return size >= 1 && size <= kMaxSizePx && size == std::floor(size); };
  if (!is_size(width_px) || !is_size(height_px)) {
    fail("image size " + std::to_string(width_px) + " x " + std::to_string(height_px) + " px is out of range");
  }
  if (k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1)
    fail("not a camera matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]");
  if (k(0, 1) != 0) fail("the camera matrix has skew " + std::to_string(k(0, 1)) + ", which no lens model here has");
  if (!(k(0, 0) > 0) || !(k(1, 1) > 0)) fail("a focal length is not positive");
  geometry::Camera camera;
  camera.name = name;
  camera.width_px = static_cast<int>(width_px);
  camera.height_px = static_cast<int>(height_px);
  const Eigen::Index count = distortion.size();
  if (fisheye && count == 4)
    camera.model = LensModel::kKannalaBrandt4;
  else if (fisheye)
    fail("a fisheye lens has 4 distortion coefficients, these are " + std::to_string(count));
  else if (distortion.isZero(0))
    camera.model = LensModel::kPinhole;
  else if (count == 1)
    camera.model = LensModel::kBrown1;
  else if (count == 2)
    camera.model = LensModel::kBrown2;
  else if (count == 4)
    camera.model = LensModel::kBrown4;
  else if (count == 5)
    camera.model = LensModel::kBrown5;
  else if (count == 8)
    camera.model = LensModel::kRational8;
  else
    fail("no lens model has " + std::to_string(count) + " distortion coefficients (0, 1, 2, 4, 5 and 8 are known)");
  camera.params.resize(geometry::NumParams(camera.model));
  camera.params.head<4>() << k(0, 0), k(1, 1), k(0, 2), k(1, 2);
  camera.params.tail(camera.params.size() - 4) = distortion.head(camera.params.size() - 4);
  return camera;
}

}  // namespace internal
}  // namespace mvstudio::calib
