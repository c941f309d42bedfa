#include "bench/triangulation.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/calib3d.hpp>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/triangulation/methods.hpp>
#include <string>

#include "core/statistics.h"

namespace mvstudio::bench {
namespace {

using triangulate::BatchOptions;
using triangulate::BatchResult;
using triangulate::PointMethod;

constexpr char kTwoSteps[] = "linear + 2 Gauss-Newton steps";

/// Shortest time of a few runs; long ones are not repeated.
double ShortestSeconds(const std::function<void()>& work) {
  double shortest = 1e300, total = 0;
  for (int i = 0; i < 5 && total < 1; ++i) {
    const Stopwatch watch;
    work();
    shortest = std::min(shortest, watch.Seconds());
    total += watch.Seconds();
  }
  return shortest;
}

TriangulationRow MakeTriangulationRow(const TriangulationProblem& problem, const std::string& method, double seconds) {
  TriangulationRow row;
  row.problem = problem.name;
  row.method = method;
  row.views = problem.batch.num_cameras;
  row.points = problem.batch.num_points;
  row.points_per_s = static_cast<double>(row.points) / seconds;
  return row;
}

void SetErrors(const TriangulationProblem& problem, const std::function<Eigen::Vector3d(int64_t)>& found,
               TriangulationRow* row) {
  std::vector<double> squares;
  for (int64_t i = 0; i < problem.batch.num_points; ++i) {
    const double error = 1000 * (found(i) - problem.truth[i]).norm();
    if (std::isfinite(error)) squares.push_back(error * error);
  }
  row->refused = 1 - static_cast<double>(squares.size()) / static_cast<double>(problem.batch.num_points);
  if (squares.empty()) return;
  row->rms_error_mm = std::sqrt(Mean(squares));
  row->median_error_mm = std::sqrt(UpperMedian(squares));
}

TriangulationRow Ours(const TriangulationProblem& problem, const std::string& name, const BatchOptions& options, int threads) {
  RunContext run;
  run.num_threads = threads;
  BatchResult result;
  const double seconds = ShortestSeconds([&] {
    const triangulate::PreparedRig rig = triangulate::Prepare(problem.rig);
    result = triangulate::TriangulateBatch(rig, problem.batch, options, run);
  });
  TriangulationRow row = MakeTriangulationRow(problem, name, seconds);
  row.threads = threads;
  row.precision = options.single_precision ? "float" : "double";
  SetErrors(
      problem, [&](int64_t i) { return Eigen::Vector3d(result.x[i], result.y[i], result.z[i]); }, &row);
  return row;
}

BatchOptions TwoSteps(bool single = false) {
  BatchOptions options;
  options.point.method = PointMethod::kAllViews;
  options.gauss_newton_steps = 2;
  options.single_precision = single;
  return options;
}

/// All points in one call on the first two cameras; the output's division by w included.
TriangulationRow OpenCv(const TriangulationProblem& problem) {
  const int64_t n = problem.batch.num_points;
  cv::Matx34d p[2];
  for (int c = 0; c < 2; ++c) {
    const geometry::RigCamera& camera = problem.rig.cameras[c];
    const Eigen::Matrix<double, 3, 4> m = camera.camera.K() * geometry::ToMatrix(camera.cam_from_world).topRows<3>();
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 4; ++k) p[c](r, k) = m(r, k);
    }
  }
  cv::Mat px[2];
  for (int c = 0; c < 2; ++c) {
    px[c].create(2, static_cast<int>(n), CV_64F);
    std::copy_n(problem.batch.x_px.data() + c * n, n, px[c].ptr<double>(0));
    std::copy_n(problem.batch.y_px.data() + c * n, n, px[c].ptr<double>(1));
  }
  std::vector<Eigen::Vector3d> found(static_cast<size_t>(n));
  const double seconds = ShortestSeconds([&] {
    cv::Mat x;
    cv::triangulatePoints(p[0], p[1], px[0], px[1], x);
    for (int i = 0; i < n; ++i) {
      found[i] = Eigen::Vector3d(x.at<double>(0, i), x.at<double>(1, i), x.at<double>(2, i)) / x.at<double>(3, i);
    }
  });
  TriangulationRow row = MakeTriangulationRow(problem, "OpenCV triangulatePoints", seconds);
  row.peer = "OpenCV";
  SetErrors(
      problem, [&](int64_t i) { return found[i]; }, &row);
  return row;
}

/// Unit bearings of a pinhole camera's detections.
void MakeBearings(const TriangulationProblem& problem, int camera, opengv::bearingVectors_t* bearings) {
  const geometry::Camera& lens = problem.rig.cameras[camera].camera;
  const int64_t n = problem.batch.num_points;
  for (int64_t i = 0; i < n; ++i) {
    const double a = (problem.batch.x_px[camera * n + i] - lens.cx()) / lens.fx();
    const double b = (problem.batch.y_px[camera * n + i] - lens.cy()) / lens.fy();
    (*bearings)[static_cast<size_t>(i)] = Eigen::Vector3d(a, b, 1).normalized();
  }
}

/// With `from_pixels` the time includes the bearings, as ours does; else they are given.
TriangulationRow OpenGv(const TriangulationProblem& problem, bool midpoint, bool from_pixels) {
  std::vector<Eigen::Vector3d> found(static_cast<size_t>(problem.batch.num_points));
  opengv::bearingVectors_t bearings[2] = {opengv::bearingVectors_t(found.size()), opengv::bearingVectors_t(found.size())};
  for (int c = 0; c < 2; ++c) MakeBearings(problem, c, &bearings[c]);
  const geometry::Rigid3 world_from_first = geometry::Inverse(problem.rig.cameras[0].cam_from_world);
  const geometry::Rigid3 first_from_second =
      problem.rig.cameras[0].cam_from_world * geometry::Inverse(problem.rig.cameras[1].cam_from_world);
  const opengv::rotation_t rotation = first_from_second.rotation.toRotationMatrix();
  const double seconds = ShortestSeconds([&] {
    if (from_pixels) MakeBearings(problem, 0, &bearings[0]), MakeBearings(problem, 1, &bearings[1]);
    const opengv::relative_pose::CentralRelativeAdapter adapter(bearings[0], bearings[1], first_from_second.translation,
                                                                rotation);
    for (size_t i = 0; i < found.size(); ++i) {
      found[i] = midpoint ? opengv::triangulation::triangulate2(adapter, i) : opengv::triangulation::triangulate(adapter, i);
    }
  });
  const std::string name = midpoint ? "OpenGV triangulate2" : "OpenGV triangulate";
  TriangulationRow row = MakeTriangulationRow(problem, name + (from_pixels ? "" : ", rays given"), seconds);
  row.peer = "OpenGV";
  SetErrors(
      problem, [&](int64_t i) { return Eigen::Vector3d(world_from_first * found[i]); }, &row);
  return row;
}

std::vector<TriangulationRow> BenchMethods(uint64_t seed) {
  const TriangulationProblem pinhole = MakeTriangulationProblem("5 views", 5, 100000, false, 0, seed);
  const TriangulationProblem lenses = MakeTriangulationProblem("5 views, distorted", 5, 100000, true, 0, seed);
  const TriangulationProblem few = MakeTriangulationProblem("5 views", 5, 20000, false, 0, seed);
  std::vector<TriangulationRow> rows;
  for (const TriangulationProblem* problem : {&pinhole, &lenses}) {
    for (const bool single : {false, true}) rows.push_back(Ours(*problem, kTwoSteps, TwoSteps(single), 1));
    rows.push_back(Ours(*problem, "robust", {}, 1));
  }
  for (const PointMethod method : triangulate::kAllPointMethods) {
    if (method == PointMethod::kRobust) continue;
    BatchOptions options;
    options.point.method = method;
    rows.push_back(Ours(few, std::string(ToString(method)), options, 1));
  }
  return rows;
}

std::vector<TriangulationRow> BenchTwoViews(uint64_t seed) {
  const TriangulationProblem problem = MakeTriangulationProblem("2 views", 2, 100000, false, 0, seed);
  BatchOptions midpoint;
  midpoint.point.method = PointMethod::kMidpoint;
  return {Ours(problem, kTwoSteps, TwoSteps(), 1),
          Ours(problem, "robust", {}, 1),
          Ours(problem, "midpoint", midpoint, 1),
          OpenCv(problem),
          OpenGv(problem, false, true),
          OpenGv(problem, false, false),
          OpenGv(problem, true, true),
          OpenGv(problem, true, false)};
}

std::vector<TriangulationRow> BenchOutliers(uint64_t seed) {
  const TriangulationProblem problem = MakeTriangulationProblem("8 views, 2 wrong", 8, 20000, false, 2, seed);
  const TriangulationProblem lenses = MakeTriangulationProblem("8 views, 2 wrong, distorted", 8, 20000, true, 2, seed);
  return {Ours(problem, "robust", {}, 1), Ours(problem, kTwoSteps, TwoSteps(), 1), Ours(lenses, "robust", {}, 1)};
}

std::vector<TriangulationRow> BenchScaling(uint64_t seed, int64_t max_points) {
  std::vector<TriangulationRow> rows;
  for (const int threads : {1, 2}) {
    for (int64_t points = 1000; points <= max_points; points *= 10) {
      const auto problem = MakeTriangulationProblem("scaling with points", 5, points, false, 0, seed);
      rows.push_back(Ours(problem, kTwoSteps, TwoSteps(), threads));
    }
    for (const int views : {2, 3, 5, 8, 16, 31}) {
      const auto problem =
          MakeTriangulationProblem("scaling with views", views, std::min<int64_t>(max_points, 50000), false, 0, seed);
      rows.push_back(Ours(problem, kTwoSteps, TwoSteps(), threads));
      rows.push_back(Ours(problem, "robust", {}, threads));
    }
  }
  return rows;
}

/// For bench/peers/run.py: the same points, in files that numpy reads in one line.
void WriteForPeers(const std::filesystem::path& folder, uint64_t seed) {
  std::filesystem::create_directories(folder);
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const auto& [name, views, outliers] : {std::tuple("5 views", 5, 0), std::tuple("8 views, 2 wrong", 8, 2)}) {
    const TriangulationProblem problem = MakeTriangulationProblem(name, views, 2000, false, outliers, seed);
    const std::string file = "problem_" + std::to_string(views) + ".f64";
    std::ofstream out(folder / file, std::ios::binary);
    const auto write = [&out](const double* values, size_t count) {
      out.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(double)));
    };
    for (const geometry::RigCamera& camera : problem.rig.cameras) {
      const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> p =
          camera.camera.K() * geometry::ToMatrix(camera.cam_from_world).topRows<3>();
      write(p.data(), 12);
    }
    write(problem.batch.x_px.data(), problem.batch.x_px.size());
    write(problem.batch.y_px.data(), problem.batch.y_px.size());
    for (const Eigen::Vector3d& x : problem.truth) write(x.data(), 3);
    list.push_back({{"problem", name}, {"views", views}, {"points", problem.batch.num_points}, {"file", file}});
  }
  std::ofstream(folder / "problems.json") << list.dump(1) << "\n";
}

void Print(const TriangulationRow& row) {
  std::printf("%-28s %-30s %-6s %5d %9lld %3d %13.0f %10.4f %10.4f %7.2f%% %s\n", row.problem.c_str(), row.method.c_str(),
              row.precision.c_str(), row.views, static_cast<long long>(row.points), row.threads, row.points_per_s,
              row.rms_error_mm, row.median_error_mm, 100 * row.refused, row.peer.c_str());
}

nlohmann::ordered_json ToJson(const TriangulationRow& row) {
  return {{"problem", row.problem},
          {"method", row.method},
          {"precision", row.precision},
          {"views", row.views},
          {"points", row.points},
          {"threads", row.threads},
          {"points_per_s", row.points_per_s},
          {"rms_error_mm", row.rms_error_mm},
          {"median_error_mm", row.median_error_mm},
          {"refused", row.refused},
          {"peer", row.peer}};
}

}  // namespace
}  // namespace mvstudio::bench

/// bench_triangulation [SEED] [JSON FILE or -] [LARGEST NUMBER OF POINTS] [FOLDER FOR THE PEERS or -] [HTML FILE]
int main(int argc, char** argv) {
  using namespace mvstudio::bench;
  const uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1;
  const int64_t max_points = argc > 3 ? std::atoll(argv[3]) : 1000000;
  if (argc > 4 && std::string(argv[4]) != "-") WriteForPeers(argv[4], seed);
  std::vector<TriangulationRow> all;
  nlohmann::ordered_json json = {{"seed", seed}, {"rows", nlohmann::ordered_json::array()}};
  std::printf("%-28s %-30s %-6s %5s %9s %3s %13s %10s %10s %8s %s\n", "problem", "method", "number", "views", "points", "thr",
              "points/s", "rms mm", "median mm", "refused", "peer");
  for (const auto& rows : {BenchMethods(seed), BenchTwoViews(seed), BenchOutliers(seed), BenchScaling(seed, max_points)}) {
    for (const TriangulationRow& row : rows) {
      Print(row);
      json["rows"].push_back(ToJson(row));
      all.push_back(row);
    }
  }
  if (argc > 5) WriteScalingFigure(all, argv[5]);
  if (argc > 2 && std::string(argv[2]) != "-") std::ofstream(argv[2]) << json.dump(1) << "\n";
  return 0;
}
