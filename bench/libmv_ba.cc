// The three bundle adjustment problems that come with Ceres (data/libmv-ba-problems: camera motion from film shots, one lens
// for all images, focal length, k1 and k2 free), solved by SolvePointBundle and by Ceres in the same run.
//   bench_libmv_ba [FOLDER [OUT.json]]
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/quality.h"
#include "calib/points/point_bundle.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::bench {
namespace {

using calib::PointObservation;
using calib::PointScene;

struct Problem {
  PointScene scene;
  std::vector<PointObservation> observations;
};

/// Little-endian values, checked against the end of the file.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), text_(ReadFile(path)) {}
  template <class T>
  T Get() {
    T value;
    if (text_.size() - at_ < sizeof value) throw FormatError(path_, "byte " + std::to_string(at_), "the file is truncated");
    std::memcpy(&value, text_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  int Count() {
    const auto count = Get<int32_t>();
    if (count < 0 || count > 10'000'000) throw FormatError(path_, "byte " + std::to_string(at_), "a count is out of range");
    return count;
  }

 private:
  std::string path_, text_;
  size_t at_ = 0;
};

Problem ReadProblem(const std::string& path) {
  Reader in(path);
  if (in.Get<char>() != 'v' || in.Get<char>() != 'P') throw FormatError(path, "", "little-endian pixels ('vP') were expected");
  double k[8];  // focal length, centre, k1, k2, k3, p1, p2
  for (double& value : k) value = in.Get<float>();
  Problem problem;
  PointScene& scene = problem.scene;
  geometry::Camera lens;
  lens.name = "lens", lens.model = geometry::LensModel::kBrown5;
  lens.width_px = lens.height_px = 2048;
  lens.params.resize(9);
  lens.params << k[0], k[0], k[1], k[2], k[3], k[4], k[6], k[7], k[5];
  scene.lenses = {lens};
  std::map<int, int> cameras, points;
  for (int n = in.Count(), i = 0; i < n; ++i) {
    cameras[in.Get<int32_t>()] = i;
    Eigen::Matrix3d rotation;
    for (int j = 0; j < 9; ++j) rotation(j % 3, j / 3) = in.Get<float>();
    geometry::Rigid3 pose;
    pose.rotation = geometry::NearestRotation(rotation);
    for (int j = 0; j < 3; ++j) pose.translation[j] = in.Get<float>();
    scene.cam_from_world.push_back(pose);
    scene.lens_of_camera.push_back(0);
  }
  const int num_points = in.Count();
  scene.points.resize(3, num_points);
  for (int i = 0; i < num_points; ++i) {
    points[in.Get<int32_t>()] = i;
    for (int j = 0; j < 3; ++j) scene.points(j, i) = in.Get<float>();
  }
  for (int n = in.Count(), i = 0; i < n; ++i) {
    const int image = in.Get<int32_t>(), track = in.Get<int32_t>();
    const float x = in.Get<float>(), y = in.Get<float>();
    if (cameras.count(image) && points.count(track)) problem.observations.push_back({cameras[image], points[track], {x, y}, 1});
  }
  return problem;
}

/// Brown's lens with one focal length, as Ceres' example has it.
struct ReprojectionError {
  Eigen::Vector2d px;
  template <class T>
  bool operator()(const T* lens, const T* pose, const T* point, T* residuals) const {
    T x[3];
    ceres::AngleAxisRotatePoint(pose, point, x);
    const T a = (x[0] + pose[3]) / (x[2] + pose[5]), b = (x[1] + pose[4]) / (x[2] + pose[5]), r2 = a * a + b * b;
    const T radial = 1.0 + r2 * (lens[3] + r2 * (lens[4] + r2 * lens[5]));
    const T ad = a * radial + 2.0 * lens[6] * a * b + lens[7] * (r2 + 2.0 * a * a);
    const T bd = b * radial + 2.0 * lens[7] * a * b + lens[6] * (r2 + 2.0 * b * b);
    residuals[0] = lens[0] * ad + lens[1] - px.x();
    residuals[1] = lens[0] * bd + lens[2] - px.y();
    return true;
  }
};

struct Outcome {
  std::string method;
  double cost = 0;  ///< half the sum of squares, as Ceres counts
  double seconds = 0;
  int iterations = 0;
  double focal_px = 0;
};

Outcome SolveByCeres(const Problem& input, bool as_example, int threads) {
  Problem p = input;
  const Eigen::VectorXd& from = p.scene.lenses[0].params;
  double lens[8] = {from[0], from[2], from[3], from[4], from[5], from[8], from[6], from[7]};
  std::vector<std::array<double, 6>> poses;
  for (const geometry::Rigid3& pose : p.scene.cam_from_world) {
    const Eigen::Vector3d w = geometry::RotationLog(pose.rotation), &t = pose.translation;
    poses.push_back({w.x(), w.y(), w.z(), t.x(), t.y(), t.z()});
  }
  const Stopwatch watch;
  ceres::Problem problem;
  for (const PointObservation& o : p.observations) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ReprojectionError, 2, 8, 6, 3>(new ReprojectionError{o.px}),
                             nullptr, lens, poses[o.camera_idx].data(), p.scene.points.col(o.point_idx).data());
  }
  problem.SetParameterBlockConstant(poses[input.observations[0].camera_idx].data());
  problem.SetManifold(lens, new ceres::SubsetManifold(8, {1, 2, 5, 6, 7}));
  ceres::Solver::Options options;
  options.max_num_iterations = 100;
  options.num_threads = threads;
  options.logging_type = ceres::SILENT;
  if (as_example) {
    options.use_nonmonotonic_steps = true;
    options.preconditioner_type = ceres::SCHUR_JACOBI;
    options.linear_solver_type = ceres::ITERATIVE_SCHUR;
    options.use_inner_iterations = true;
    options.num_threads = 1;
  } else {
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  }
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {as_example ? "Ceres, as its example" : "Ceres, sparse Cholesky", summary.final_cost, watch.Seconds(),
          static_cast<int>(summary.iterations.size()), lens[0]};
}

Outcome SolveByUs(const Problem& input, int threads) {
  Problem p = input;
  const Stopwatch watch;
  calib::PointBundleOptions options;
  options.lens_directions = {calib::FocalDirections(p.scene.lenses[0], 2)};
  options.fix_camera.assign(p.scene.cam_from_world.size(), false);
  options.fix_camera[p.observations[0].camera_idx] = true;
  options.reject_outliers = false;
  options.num_threads = threads;
  options.cost_tolerance = 1e-7;
  const calib::PointBundleReport report = SolvePointBundle(&p.scene, &p.observations, options);
  return {"SolvePointBundle", report.cost / 2, watch.Seconds(), report.num_iterations, p.scene.lenses[0].fx()};
}

int Run(const std::string& folder, const std::string& out) {
  const double reference[] = {4534.72, 5207.93, 297.043};
  const int threads = ResolveThreads(0);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  bool reached = true;
  std::printf("%-10s %-24s %12s %10s %9s %6s %10s\n", "problem", "method", "cost", "to ref.", "s", "steps", "focal px");
  for (int i = 0; i < 3; ++i) {
    const std::string name = "problem_0" + std::to_string(i + 1);
    const Problem problem = ReadProblem(folder + "/" + name + ".bin");
    const std::vector<Outcome> outcomes = {SolveByUs(problem, threads), SolveByCeres(problem, true, threads),
                                           SolveByCeres(problem, false, threads)};
    for (const Outcome& o : outcomes) {
      const double excess = o.cost / reference[i] - 1;
      std::printf("%-10s %-24s %12.4f %+10.1e %9.3f %6d %10.2f\n", name.c_str(), o.method.c_str(), o.cost, excess, o.seconds,
                  o.iterations, o.focal_px);
      rows.push_back({{"problem", name},
                      {"method", o.method},
                      {"cost", o.cost},
                      {"reference_cost", reference[i]},
                      {"seconds", o.seconds},
                      {"steps", o.iterations}});
    }
    std::printf("%-10s time ratio to Ceres' example %.3f, to sparse Cholesky %.3f\n", "",
                outcomes[0].seconds / outcomes[1].seconds, outcomes[0].seconds / outcomes[2].seconds);
    reached &= outcomes[0].cost <= reference[i] * (1 + 1e-4);
  }
  if (!out.empty()) WriteFileAtomic(out, rows.dump(2) + "\n");
  std::printf("%s\n", reached ? "all of Ceres' costs reached to 1e-4" : "a cost is MISSED");
  return reached ? 0 : 1;
}

}  // namespace
}  // namespace mvstudio::bench

int main(int argc, char** argv) {
  const char* data = std::getenv("MVSTUDIO_DATA");
  const std::string folder =
      argc > 1 ? argv[1] : std::string(data ? data : "../shared/data") + "/libmv_ba/data/libmv-ba-problems";
  try {
    return mvstudio::bench::Run(folder, argc > 2 ? argv[2] : "");
  } catch (const mvstudio::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
