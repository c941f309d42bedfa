#include "avatar/body/smpl/read.h"

#include <algorithm>
#include <cmath>

#include "avatar/body/rig_rules.h"
#include "avatar/body/smpl/layout.h"
#include "avatar/body/template_atlas.h"
#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "dataset/arrays/npz.h"
#include "dataset/arrays/pickle.h"

namespace mvstudio::body {
namespace {

using internal::SmplLayout;

/// Rows (x, y, z) of SMPL's frame, y up -> body.
template <class Rows>
void TurnRows(Rows&& x) {
  const auto y = x.row(1).eval();
  x.row(1) = -x.row(2);
  x.row(2) = y;
}

/// (V, 3, N) -> (3V, N) in body.
Eigen::MatrixXf Directions(const NpyArray& array) {
  const auto count = static_cast<Eigen::Index>(array.shape[2]), rows = static_cast<Eigen::Index>(3 * array.shape[0]);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::MatrixXf directions = Eigen::Map<const RowMajor>(array.values.data(), rows, count).cast<float>();
  for (Eigen::Index i = 0; i < rows; i += 3) TurnRows(directions.middleRows<3>(i));
  return directions;
}

/// Columns for entries of rotations in SMPL's frame -> for those in body. With A from SMPL's frame to body, a rotation R there
/// is A R A^T here, so entry (r, c) goes to the place where A has the axes r and c, with the product of their signs.
Eigen::MatrixXf TurnColumns(const Eigen::MatrixXf& directions) {
  static constexpr int kAxis[] = {0, 2, 1}, kSign[] = {1, 1, -1};
  Eigen::MatrixXf rotated(directions.rows(), directions.cols());
  for (Eigen::Index first = 0; first < directions.cols(); first += 9) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        rotated.col(first + 3 * kAxis[r] + kAxis[c]) =
            static_cast<float>(kSign[r] * kSign[c]) * directions.col(first + 3 * r + c);
      }
    }
  }
  return rotated;
}

void SetSmplSkin(const SmplLayout& layout, BodyTemplate* body) {
  std::vector<std::vector<std::pair<int, double>>> weights(static_cast<size_t>(layout.num_vertices));
  for (int v = 0; v < layout.num_vertices; ++v) {
    for (int b = 0; b < layout.num_bones; ++b) {
      const double weight = layout.weights->values[static_cast<size_t>(v) * layout.num_bones + b];
      if (weight > 0) weights[v].emplace_back(b, weight);
    }
  }
  SetSkin(std::move(weights), body);
}

/// `x` (3, V) in body; the lowest vertex stays on the floor.
void SetSmplShapes(const SmplLayout& layout, Eigen::Index lowest, BodyTemplate* body) {
  BlendShapes& shapes = body->shapes;
  shapes.vertices.resize(3 * layout.num_vertices, 0);
  if (layout.shapes) shapes.vertices = Directions(*layout.shapes);
  const Eigen::Index count = shapes.vertices.cols();
  for (Eigen::Index s = 0; s < count; ++s) {
    auto points = shapes.vertices.col(s).reshaped(3, layout.num_vertices);
    const float sunk = points(2, lowest);
    points.row(2).array() -= sunk;
    shapes.names.push_back("shape " + std::to_string(s + 1));
  }
  shapes.low.setConstant(count, -3);
  shapes.high.setConstant(count, 3);
  shapes.sigma.setOnes(count);
}

}  // namespace

BodyTemplate SmplFromArrays(const std::map<std::string, NpyArray>& arrays, const std::string& path) {
  const SmplLayout layout = internal::CheckSmplLayout(arrays, path);
  BodyTemplate body;
  internal::SetSmplBones(layout, &body);
  Eigen::Matrix3Xd x = Eigen::Map<const Eigen::Matrix3Xd>(layout.vertices->values.data(), 3, layout.num_vertices);
  TurnRows(x);
  Eigen::Index lowest = 0;
  const double sole = x.row(2).minCoeff(&lowest);
  x.row(2).array() -= sole;
  body.vertices = x.cast<float>();
  const auto num_faces = static_cast<Eigen::Index>(layout.faces->shape[0]);
  body.faces = Eigen::Map<const Eigen::Matrix3Xd>(layout.faces->values.data(), 3, num_faces).cast<int>();
  SetSmplSkin(layout, &body);
  SetSmplShapes(layout, lowest, &body);
  if (layout.pose) body.pose_directions = TurnColumns(Directions(*layout.pose));
  PlaceRig(internal::SmplRules(layout, x, body), x, body.shapes.vertices, &body);
  BuildTemplateAtlas(&body);
  return body;
}

std::map<std::string, NpyArray> ReadSmplArrays(const std::string& path) {
  const auto ends_in = [&path](const std::string& end) {
    return path.size() >= end.size() && path.compare(path.size() - end.size(), end.size(), end) == 0;
  };
  const bool pickle = ends_in(".pkl");
  if (!pickle && !ends_in(".npz")) throw FormatError(path, "", "must be a .npz or .pkl file");
  std::map<std::string, NpyArray> all, arrays;
  std::map<std::string, std::string> members;  // others may hold objects
  if (pickle) all = dataset::ArraysFromPickle(ReadFile(path), path);
  if (!pickle) members = dataset::ReadNpzMembers(path);
  for (const std::string& name : internal::SmplArrayNames()) {
    if (const auto found = all.find(name); found != all.end()) arrays[name] = std::move(found->second);
    if (const auto found = members.find(name); found != members.end())
      arrays[name] = ParseNpy(found->second, path + ": " + name);
  }
  return arrays;
}

BodyTemplate ReadSmpl(const std::string& path) { return SmplFromArrays(ReadSmplArrays(path), path); }

std::string SmplNpz(const std::map<std::string, NpyArray>& arrays, const std::string& path) {
  internal::CheckSmplLayout(arrays, path);
  std::vector<std::pair<std::string, std::string>> members;
  for (const std::string& name : internal::SmplArrayNames()) {
    const auto found = arrays.find(name);
    if (found == arrays.end()) continue;
    const NpyArray& array = found->second;
    const std::vector<size_t> shape(array.shape.begin(), array.shape.end());
    const bool indices = name == "f" || name == "kintree_table";
    const auto wholes = [&array] { return std::vector<int64_t>(array.values.begin(), array.values.end()); };
    members.emplace_back(name, indices ? NpyOfInts(shape, wholes()) : NpyOfDoubles(shape, array.values));
  }
  return NpzOf(members);
}

}  // namespace mvstudio::body
