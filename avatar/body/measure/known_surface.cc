#include "avatar/body/measure/known_surface.h"

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "core/disk/npy.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/arrays/npz.h"

namespace mvstudio::body {
namespace {

namespace fs = std::filesystem;

constexpr char kRestFile[] = "subject_rest.npz", kMotionFile[] = "motion.npz";

using Members = std::map<std::string, std::string>;

/// The arrays of one file, with errors that name them.
class Archive {
 public:
  explicit Archive(std::string path) : path_(std::move(path)), members_(dataset::ReadNpzMembers(path_)) {}

  [[noreturn]] void Refuse(const std::string& name, const std::string& what) const { throw FormatError(path_, name, what); }
  bool Has(const std::string& name) const { return members_.count(name) > 0; }
  std::vector<std::string> Texts(const std::string& name) const { return ParseNpyTexts(Bytes(name), path_ + ": " + name); }

  /// Shape with -1 for any size.
  NpyArray Numbers(const std::string& name, const std::vector<int64_t>& shape) const {
    NpyArray array = ParseNpy(Bytes(name), path_ + ": " + name);
    bool fits = array.shape.size() == shape.size();
    for (size_t i = 0; fits && i < shape.size(); ++i)
      fits = (shape[i] < 0 || shape[i] == array.shape[i]) && array.shape[i] < std::numeric_limits<int>::max() / 16;
    if (!fits) Refuse(name, "has another shape than expected");
    return array;
  }

  Eigen::Matrix3Xd Points(const std::string& name, int64_t count) const {
    const NpyArray array = Numbers(name, {count, 3});
    return Eigen::Map<const Eigen::Matrix3Xd>(array.values.data(), 3, array.shape[0]);
  }

 private:
  const std::string& Bytes(const std::string& name) const {
    const auto found = members_.find(name);
    if (found == members_.end()) Refuse(name, "is missing");
    return found->second;
  }

  std::string path_;
  Members members_;
};

/// Fans of triangles; throws FormatError for faces with fewer than three corners, or corners that are no vertices.
Eigen::Matrix3Xi Triangles(const Archive& file, const std::string& mesh, int64_t vertices) {
  const std::vector<double> sizes = file.Numbers(mesh + "_face_size", {-1}).values;
  const std::vector<double> corners = file.Numbers(mesh + "_face_v", {-1}).values;
  std::vector<int> triangles;
  size_t first = 0;
  for (const double size : sizes) {
    const auto count = static_cast<size_t>(size);
    if (!(size >= 3) || count > corners.size() - first) file.Refuse(mesh + "_face_size", "does not match " + mesh + "_face_v");
    for (size_t k = 0; k < count; ++k) {
      const double corner = corners[first + k];
      if (!(corner >= 0 && corner < static_cast<double>(vertices)))
        file.Refuse(mesh + "_face_v", "names a vertex that is not there");
      if (k >= 2) {
        for (const size_t at : {size_t{0}, k - 1, k}) triangles.push_back(static_cast<int>(corners[first + at]));
      }
    }
    first += count;
  }
  return Eigen::Map<const Eigen::Matrix3Xi>(triangles.data(), 3, static_cast<Eigen::Index>(triangles.size()) / 3);
}

Eigen::Matrix3Xi Uncovered(const Eigen::Matrix3Xi& faces, const std::vector<double>& covered) {
  std::vector<int> kept;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const bool hidden = covered[faces(0, f)] != 0 && covered[faces(1, f)] != 0 && covered[faces(2, f)] != 0;
    if (!hidden) kept.insert(kept.end(), {faces(0, f), faces(1, f), faces(2, f)});
  }
  return Eigen::Map<const Eigen::Matrix3Xi>(kept.data(), 3, static_cast<Eigen::Index>(kept.size()) / 3);
}

/// Frames of the files vertices_%08d.npz.
std::vector<int> FramesIn(const std::string& folder) {
  std::vector<int> frames;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    int frame = 0;
    if (std::sscanf(name.c_str(), "vertices_%8d.npz", &frame) == 1 && frame >= 0 && name == Format("vertices_%08d.npz", frame))
      frames.push_back(frame);
  }
  std::sort(frames.begin(), frames.end());
  return frames;
}

}  // namespace

KnownSurface::KnownSurface(const std::string& folder) : folder_(folder) {
  if (!fs::is_directory(folder)) throw IoError(folder, "is no folder");
  if (!fs::exists(folder_ + "/" + kRestFile)) folder_ += "/truth";
  if (!fs::exists(folder_ + "/" + kRestFile))
    throw IoError(folder, std::string("holds no ") + kRestFile + ", nor does its folder truth: no true surface is known");
  ReadMeshes();
  ReadBones();
  frames_ = FramesIn(folder_);
  if (frames_.empty()) throw IoError(folder_, "holds no vertices_%08d.npz");
}

void KnownSurface::ReadMeshes() {
  const Archive file(folder_ + "/" + kRestFile);
  for (const std::string& name : file.Texts("names")) {
    Mesh mesh;
    mesh.name = name;
    mesh.rest = file.Points(name + "_v", -1);
    std::vector<double> covered(static_cast<size_t>(mesh.rest.cols()), 0);
    if (file.Has(name + "_covered")) covered = file.Numbers(name + "_covered", {mesh.rest.cols()}).values;
    mesh.faces = Triangles(file, name, mesh.rest.cols());
    mesh.outer_faces = Uncovered(mesh.faces, covered);
    for (size_t v = 0; v < covered.size(); ++v) {
      if (covered[v] == 0) mesh.bare.push_back(static_cast<int>(v));
    }
    if (file.Has(name + "_weights")) {
      const NpyArray weights = file.Numbers(name + "_weights", {mesh.rest.cols(), -1});
      mesh.weights = Eigen::Map<const Eigen::MatrixXd>(weights.values.data(), weights.shape[1], weights.shape[0]);
    }
    meshes_.push_back(std::move(mesh));
  }
  if (meshes_.empty()) file.Refuse("names", "names no mesh");
}

void KnownSurface::ReadBones() {
  const std::string path = folder_ + "/" + kMotionFile;
  if (!fs::exists(path)) return;
  NpyArray transforms = Archive(path).Numbers("transforms", {-1, -1, 3, 4});
  num_transforms_ = transforms.shape[0], num_bones_ = transforms.shape[1];
  transforms_ = std::move(transforms.values);
}

std::vector<Eigen::Matrix3Xd> KnownSurface::Vertices(int frame) const {
  const Archive file(folder_ + Format("/vertices_%08d.npz", frame));
  std::vector<Eigen::Matrix3Xd> vertices;
  for (const Mesh& mesh : meshes_) vertices.push_back(file.Points(mesh.name, mesh.rest.cols()));
  return vertices;
}

Surface KnownSurface::Outer(const std::vector<Eigen::Matrix3Xd>& vertices) const {
  Surface all;
  Eigen::Index count = 0, faces = 0;
  for (const Mesh& mesh : meshes_) count += mesh.rest.cols(), faces += mesh.outer_faces.cols();
  all.vertices.resize(3, count), all.faces.resize(3, faces);
  count = faces = 0;
  for (size_t m = 0; m < meshes_.size(); ++m) {
    const Eigen::Matrix3Xi& own = meshes_[m].outer_faces;
    all.vertices.middleCols(count, vertices[m].cols()) = vertices[m];
    all.faces.middleCols(faces, own.cols()) = own.array() + static_cast<int>(count);
    count += vertices[m].cols(), faces += own.cols();
  }
  return all;
}

std::optional<Eigen::Matrix3Xd> KnownSurface::Unposed(const Mesh& mesh, const Eigen::Matrix3Xd& vertices, int frame) const {
  if (mesh.weights.rows() == 0 || mesh.weights.rows() != num_bones_ || frame < 0 || frame >= num_transforms_) return {};
  using Affine = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  Eigen::Matrix3Xd unposed(3, vertices.cols());
  for (Eigen::Index v = 0; v < vertices.cols(); ++v) {
    Affine world_from_rest = Affine::Zero();
    for (int64_t b = 0; b < num_bones_; ++b) {
      if (mesh.weights(b, v) == 0) continue;
      world_from_rest += mesh.weights(b, v) * Eigen::Map<const Affine>(&transforms_[12 * (frame * num_bones_ + b)]);
    }
    const Eigen::Matrix3d linear = world_from_rest.leftCols<3>();
    constexpr double kFlat = 0.05;  // of the volume; skinning by rotations keeps most of it
    unposed.col(v) = linear.determinant() > kFlat
                         ? Eigen::Vector3d(linear.inverse() * (vertices.col(v) - world_from_rest.col(3)))
                         : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return unposed;
}

}  // namespace mvstudio::body
