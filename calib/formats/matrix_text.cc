#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <sstream>

#include "calib/formats/format_camera.h"
#include "calib/formats/format_text.h"
#include "calib/formats/photogrammetry.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

/// A line with something in it.
struct Row {
  std::vector<std::string> words;
  std::vector<double> numbers;  ///< of all words; empty where one is none
  size_t size() const { return numbers.size(); }
};
using Rows = std::vector<Row>;

struct TextCamera {
  std::string name;
  Eigen::Matrix3d k, rotation;
  Eigen::Vector3d translation;
  Eigen::VectorXd distortion;
  Eigen::Vector2d size = Eigen::Vector2d::Zero();  ///< 0: not in the file
  bool centred = false;                            ///< the principal point is the image's middle
  bool placed = true;
};

std::optional<double> NumberIn(const std::string& word) {
  double value = 0;
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  const bool whole = code == std::errc() && end == word.data() + word.size() && std::isfinite(value);
  return whole ? std::optional(value) : std::nullopt;
}

Rows RowsOf(std::string_view text) {
  constexpr size_t kMostRows = 100000;
  Rows rows;
  std::istringstream in{std::string(text)};
  for (std::string line; rows.size() < kMostRows && std::getline(in, line);) {
    Row row;
    std::istringstream words(line);
    for (std::string word; words >> word;) row.words.push_back(word);
    if (row.words.empty()) continue;
    for (const std::string& word : row.words) {
      const auto number = NumberIn(word);
      if (!number) break;
      row.numbers.push_back(*number);
    }
    if (row.numbers.size() < row.words.size()) row.numbers.clear();
    rows.push_back(std::move(row));
  }
  return rows;
}

/// Rows from `first` on have so many numbers.
bool Sizes(const Rows& rows, size_t first, std::initializer_list<size_t> sizes) {
  if (first + sizes.size() > rows.size()) return false;
  for (const size_t size : sizes) {
    if (rows[first++].size() != size) return false;
  }
  return true;
}

Eigen::MatrixXd Block(const Rows& rows, size_t first, int height, int width) {
  Eigen::MatrixXd block(height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) block(y, x) = rows[first + static_cast<size_t>(y)].numbers[static_cast<size_t>(x)];
  }
  return block;
}

Eigen::VectorXd VectorOf(const Row& row, size_t begin = 0, size_t count = std::string::npos) {
  count = std::min(count, row.numbers.size() - begin);
  return Eigen::Map<const Eigen::VectorXd>(row.numbers.data() + begin, static_cast<Eigen::Index>(count));
}

/// Without the endings that mark the kind: 00000012_cam, 0001_P.
std::string NameOfFile(const std::string& path) {
  const std::string stem = Stem(path);
  for (const std::string ending : {"_cam", "_P"}) {
    if (stem.size() > ending.size() && stem.compare(stem.size() - ending.size(), ending.size(), ending) == 0)
      return stem.substr(0, stem.size() - ending.size());
  }
  return stem;
}

/// K's last row is 0 0 1 and it has a focal length.
bool IsCameraMatrix(const Eigen::MatrixXd& k) {
  return k(1, 0) == 0 && k(2, 0) == 0 && k(2, 1) == 0 && k(2, 2) == 1 && k(0, 0) > 1 && k(1, 1) > 1;
}

/// P = s K [R t] with a positive focal length and, where that fixes the sign, a rotation.
std::optional<TextCamera> FromProjection(const Eigen::MatrixXd& p) {
  Eigen::Matrix3d m = p.leftCols<3>();
  const double det = m.determinant();
  if (!std::isfinite(det) || std::abs(det) < 1e-12 * std::pow(m.norm(), 3)) return std::nullopt;
  const double sign = det < 0 ? -1 : 1;
  m *= sign;
  // RQ by the QR of the rows in reverse order.
  const Eigen::Matrix3d flip = Eigen::Matrix3d::Identity().colwise().reverse();
  const Eigen::HouseholderQR<Eigen::Matrix3d> qr((flip * m).transpose());
  const Eigen::Matrix3d q = qr.householderQ();
  const Eigen::Matrix3d r = qr.matrixQR().triangularView<Eigen::Upper>();
  Eigen::Matrix3d k = flip * r.transpose() * flip;
  TextCamera camera{"", k, flip * q.transpose(), {}, {}};
  for (int i = 0; i < 3; ++i) {
    if (camera.k(i, i) < 0) camera.k.col(i) *= -1, camera.rotation.row(i) *= -1;
  }
  camera.translation = camera.k.inverse() * p.col(3) * sign;
  camera.k /= camera.k(2, 2);
  if (std::abs(camera.k(0, 1)) < 1e-9 * camera.k(0, 0)) camera.k(0, 1) = 0;
  if (camera.k.diagonal().head<2>().minCoeff() <= 1.001) return std::nullopt;  // a pose [R t]
  return camera;
}

std::optional<TextCamera> OneCamera(const Rows& rows) {
  TextCamera camera;
  const bool k_first = Sizes(rows, 0, {3, 3, 3}) && IsCameraMatrix(Block(rows, 0, 3, 3));
  if (k_first && rows.size() == 8 && Sizes(rows, 3, {3, 3, 3, 3}) && rows[7].size() > 0)
    return TextCamera{"", Block(rows, 0, 3, 3), Block(rows, 3, 3, 3), VectorOf(rows[6]), VectorOf(rows[7])};
  if (k_first && rows.size() == 9 && Sizes(rows, 3, {3, 3, 3, 3, 3, 2})) {  // x = K R^T (X - C)
    const Eigen::Matrix3d rotation = Block(rows, 4, 3, 3).transpose();
    camera = {"", Block(rows, 0, 3, 3), rotation, -rotation * VectorOf(rows[7]), {}, VectorOf(rows[8])};
    if (!VectorOf(rows[3]).isZero(0)) camera.distortion = VectorOf(rows[3]);
    return camera;
  }
  if (rows.size() >= 9 && rows[0].words[0] == "extrinsic" && rows[5].words[0] == "intrinsic" && Sizes(rows, 1, {4, 4, 4, 4}) &&
      Sizes(rows, 6, {3, 3, 3}))
    return TextCamera{"", Block(rows, 6, 3, 3), Block(rows, 1, 3, 3), Block(rows, 1, 3, 4).col(3), {}};
  const size_t first = !rows.empty() && rows[0].words[0] == "CONTOUR" ? 1 : 0;
  if (rows.size() == first + 3 && Sizes(rows, first, {4, 4, 4})) return FromProjection(Block(rows, first, 3, 4));
  return std::nullopt;
}

/// A count, then NAME and 21 numbers in each line.
std::vector<TextCamera> Middlebury(const Rows& rows) {
  std::vector<TextCamera> cameras;
  if (rows.size() < 2 || rows[0].size() != 1 || rows[0].numbers[0] != static_cast<double>(rows.size() - 1)) return {};
  for (size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].words.size() != 22) return {};
    Row row;
    for (size_t w = 1; w < 22; ++w) {
      const auto number = NumberIn(rows[i].words[w]);
      if (!number) return {};
      row.numbers.push_back(*number);
    }
    using Rows3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    cameras.push_back({Stem(rows[i].words[0]),
                       Eigen::Map<const Rows3>(row.numbers.data()),
                       Eigen::Map<const Rows3>(row.numbers.data() + 9),
                       VectorOf(row, 18),
                       {}});
  }
  return cameras;
}

/// NAME, K, five coefficients, [R t].
std::vector<TextCamera> NeuralVolumes(const Rows& rows) {
  std::vector<TextCamera> cameras;
  for (size_t i = 0; i < rows.size(); i += 8) {
    if (rows[i].words.size() != 1 || !Sizes(rows, i + 1, {3, 3, 3, 5, 4, 4, 4})) return {};
    if (!IsCameraMatrix(Block(rows, i + 1, 3, 3))) return {};
    cameras.push_back({rows[i].words[0], Block(rows, i + 1, 3, 3), Block(rows, i + 5, 3, 3), Block(rows, i + 5, 3, 4).col(3),
                       VectorOf(rows[i + 4])});
  }
  return cameras;
}

/// `# Bundle file v0.3`, the counts, then f k1 k2, R and t of each camera.
std::vector<TextCamera> Bundler(const Rows& rows) {
  std::vector<TextCamera> cameras;
  if (rows.size() < 7 || rows[0].words[0] != "#" || rows[0].words.size() < 2 || rows[0].words[1] != "Bundle") return {};
  if (rows[1].size() != 2) return {};
  const Eigen::Vector3d axes(1, -1, -1);
  for (size_t i = 0; i < static_cast<size_t>(std::max(rows[1].numbers[0], 0.0)); ++i) {
    const size_t at = 2 + 5 * i;
    if (!Sizes(rows, at, {3, 3, 3, 3, 3})) return {};
    const Eigen::VectorXd lens = VectorOf(rows[at]);
    TextCamera camera{"camera_" + std::to_string(i), CameraMatrix(lens[0], lens[0], 0, 0),
                      axes.asDiagonal() * Block(rows, at + 1, 3, 3), axes.cwiseProduct(Eigen::Vector3d(VectorOf(rows[at + 4]))),
                      Eigen::Vector4d(lens[1], lens[2], 0, 0)};
    camera.centred = true, camera.placed = lens[0] != 0;
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

std::vector<TextCamera> CamerasIn(std::string_view text) {
  if (text.find('{') != std::string_view::npos || text.find('<') != std::string_view::npos) return {};
  const Rows rows = RowsOf(text);
  if (const auto camera = OneCamera(rows)) return {*camera};
  for (const auto& read : {Middlebury, NeuralVolumes, Bundler}) {
    if (std::vector<TextCamera> cameras = read(rows); !cameras.empty()) return cameras;
  }
  return {};
}

}  // namespace

bool IsMatrixText(std::string_view text) { return !CamerasIn(text).empty(); }

ImportedRig ReadMatrixText(const std::vector<std::string>& paths, const ReadOptions& options) {
  ImportedRig imported;
  imported.rig.gauge = geometry::RigGauge::Other("the world of " + std::filesystem::path(paths[0]).filename().string());
  for (const std::string& path : paths) {
    std::vector<std::string> left_out;
    const std::vector<TextCamera> cameras = CamerasIn(ReadFile(path));
    if (cameras.empty()) throw FormatError(path, "", "holds no camera as matrices in text, as the files beside it do");
    for (TextCamera text : cameras) {
      const std::string name = text.name.empty() ? NameOfFile(path) : text.name;
      const Place place{path, cameras.size() > 1 ? "camera " + Printable(name) : ""};
      if (!text.placed) {
        left_out.push_back(name);
        continue;
      }
      const Eigen::Vector2d given(options.width_px, options.height_px), size = text.size[0] > 0 ? text.size : given;
      if (size[0] <= 0 || size[1] <= 0)
        throw UsageError(path + ": the file does not give the image size; pass option 'size' WIDTHxHEIGHT");
      if (text.centred) text.k(0, 2) = 0.5 * (size[0] - 1), text.k(1, 2) = 0.5 * (size[1] - 1);
      Eigen::VectorXd distortion = text.distortion;
      if (distortion.isZero(0)) distortion.resize(0);
      geometry::RigCamera camera = MakeRigCamera(name, size, text.k, distortion, false, options, place, &imported.notes);
      camera.cam_from_world = camera.cam_from_world *
                              geometry::Rigid3{MakeRotation(text.rotation, place), text.translation * options.metres_per_unit};
      AddCamera(std::move(camera), place, &imported.rig);
    }
    if (left_out.size() == cameras.size()) throw FormatError(path, "", "none of its cameras is placed: all have f = 0");
    AddLeftOut(path, left_out, &imported.notes);
  }
  imported.notes.push_back(UnitNote(options.metres_per_unit));
  return imported;
}

}  // namespace mvstudio::calib::internal
