#include "avatar/body/measure/surface_error.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "core/units.h"
#include "geometry/rig/alignment.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

constexpr double kSkip = 1e-4;  // m along a ray that its own face and the neighbours take
constexpr int kDirections = 64;

Vector3d FaceNormal(const Surface& s, Eigen::Index face) {  // its length is twice the area
  const Vector3d a = s.vertices.col(s.faces(0, face));
  return (s.vertices.col(s.faces(1, face)) - a).cross(s.vertices.col(s.faces(2, face)) - a);
}

Eigen::Matrix3Xd Normals(const Surface& s) {
  Eigen::Matrix3Xd normals = Eigen::Matrix3Xd::Zero(3, s.vertices.cols());
  for (Eigen::Index f = 0; f < s.faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) normals.col(s.faces(k, f)) += FaceNormal(s, f);
  }
  return normals;
}

Vector3d Interpolated(const Eigen::Matrix3Xd& values, const Surface& s, Eigen::Index face, const Vector3d& weights) {
  return weights[0] * values.col(s.faces(0, face)) + weights[1] * values.col(s.faces(1, face)) +
         weights[2] * values.col(s.faces(2, face));
}

double Angle(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

double TotalArea(const Surface& s) {
  double area = 0;
  for (Eigen::Index f = 0; f < s.faces.cols(); ++f) area += 0.5 * FaceNormal(s, f).norm();
  return area;
}

bool HasArea(const Surface& s) { return s.faces.cols() > 0 && TotalArea(s) > 0; }

SurfaceDistance Measure(const Surface& from, const SurfaceTree& to, int num_threads) {
  const Eigen::Matrix3Xd from_normals = Normals(from), to_normals = Normals(to.surface());
  const auto count = static_cast<size_t>(from.faces.cols());
  std::vector<double> distances(count), angles(count);
  const Vector3d middle = Vector3d::Constant(1.0 / 3);
  ParallelFor(from.faces.cols(), num_threads, [&](int64_t f) {
    const SurfaceTree::Nearest nearest = to.Find(Interpolated(from.vertices, from, f, middle));
    distances[f] = nearest.distance_m;
    angles[f] = Angle(Interpolated(from_normals, from, f, middle),
                      Interpolated(to_normals, to.surface(), nearest.face, nearest.weights));
  });
  SurfaceDistance distance;
  const double total = TotalArea(from);
  for (size_t f = 0; f < count; ++f) {
    const double share = 0.5 * FaceNormal(from, static_cast<Eigen::Index>(f)).norm() / total;
    distance.mean_m += share * distances[f], distance.normal_rad += share * angles[f];
  }
  distance.p95_m = LinearQuantile(distances, 0.95);
  return distance;
}

void MeasureVertices(const Surface& surface, const SurfaceTree& to, int num_threads, SurfaceError* error) {
  std::vector<int> used(surface.faces.data(), surface.faces.data() + surface.faces.size());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  error->vertex_m.assign(static_cast<size_t>(surface.vertices.cols()), std::numeric_limits<double>::quiet_NaN());
  ParallelFor(static_cast<int64_t>(used.size()), num_threads,
              [&](int64_t i) { error->vertex_m[used[i]] = to.Find(surface.vertices.col(used[i])).distance_m; });
  double sum = 0;
  for (const int v : used) sum += std::pow(error->vertex_m[v], 2);
  error->vertex_rms_m = std::sqrt(sum / static_cast<double>(used.size()));
}

/// Unit vectors on a golden spiral.
std::vector<Vector3d> EvenDirections() {
  std::vector<Vector3d> directions;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2 * i + 1.0) / kDirections, angle = i * kPi * (3 - std::sqrt(5.0)), r = std::sqrt(1 - z * z);
    directions.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  return directions;
}

}  // namespace

VertexError CompareVertices(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xd& truth) {
  MVS_CHECK(vertices.cols() == truth.cols(), vertices.cols() << " vertices against " << truth.cols());
  VertexError error;
  if (!vertices.allFinite() || !truth.allFinite()) return {Status::kNonFiniteInput, NAN, NAN};
  const geometry::Alignment alignment = geometry::AlignPoints(vertices, truth, true);
  if (alignment.status != Status::kOk) return {alignment.status, NAN, NAN};
  error.mean_m = (vertices - truth).colwise().norm().mean();
  const Eigen::Matrix3d rotation = alignment.scale * alignment.b_from_a.rotation.toRotationMatrix();
  const Eigen::Matrix3Xd aligned = (rotation * vertices).colwise() + alignment.b_from_a.translation;
  error.procrustes_m = (aligned - truth).colwise().norm().mean();
  return error;
}

SurfaceError CompareSurfaces(const Surface& surface, const Surface& truth, int num_threads) {
  SurfaceError error;
  error.status = Status::kNonFiniteInput;
  if (!surface.vertices.allFinite() || !truth.vertices.allFinite()) return error;
  error.status = Status::kDegenerate;
  if (!HasArea(surface) || !HasArea(truth)) return error;
  error.status = Status::kOk;
  const SurfaceTree to(truth);
  error.to_truth = Measure(surface, to, num_threads);
  error.from_truth = Measure(truth, SurfaceTree(surface), num_threads);
  MeasureVertices(surface, to, num_threads, &error);
  return error;
}

Surface SeenFromOutside(const Surface& surface, int num_threads) {
  if (surface.faces.cols() == 0 || !surface.vertices.allFinite()) return surface;
  const SurfaceTree tree(surface);
  const std::vector<Vector3d> directions = EvenDirections();
  std::vector<uint8_t> seen(static_cast<size_t>(surface.faces.cols()), 0);
  ParallelFor(surface.faces.cols(), num_threads, [&](int64_t f) {
    const Vector3d normal = FaceNormal(surface, f);
    const Vector3d centroid = Interpolated(surface.vertices, surface, f, Vector3d::Constant(1.0 / 3));
    for (const double side : {1.0, -1.0}) {
      for (size_t d = 0; d < directions.size() && !seen[f]; ++d)
        seen[f] = side * directions[d].dot(normal) > 0 && !tree.Meets(centroid, directions[d], kSkip);
    }
  });
  Surface out{surface.vertices, {}};
  const Eigen::Index count = std::count(seen.begin(), seen.end(), 1);
  out.faces.resize(3, count);
  for (Eigen::Index f = 0, at = 0; f < surface.faces.cols(); ++f) {
    if (seen[f]) out.faces.col(at++) = surface.faces.col(f);
  }
  return out;
}

}  // namespace mvstudio::body
