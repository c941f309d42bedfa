#include "bench/calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "bench/quality.h"
#include "calib/covariance/projection_uncertainty.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::bench {
namespace {

constexpr double kNoisePx = 0.3;
constexpr int kMapCols = 12, kMapRows = 8;
constexpr double kMapDistance = 3;
constexpr int kRepeats = 3;  // in turns; the shortest time counts

struct Size {
  int cameras, corners;
};
constexpr Size kSizes[] = {{8, 17600}, {16, 45500}, {31, 100900}};

Solution SolveByUs(const RigScene& scene, calib::BundleOptions options, int num_threads) {
  options.num_threads = num_threads;
  Solution solution{{}, scene.start, scene.views, 0};
  const Stopwatch watch;
  solution.report = calib::SolveBundle(&solution.views, &solution.state, options);
  solution.seconds = watch.Seconds();
  return solution;
}

UncertaintyMap MapByUs(const Solution& solution, calib::BundleOptions options, int num_threads) {
  options.num_threads = num_threads;
  const Stopwatch watch;
  const calib::ProjectionUncertainty uncertainty(solution.views, solution.state, options, kNoisePx);
  const Eigen::MatrixXd sigmas = uncertainty.UncertaintyMap(0, kMapCols, kMapRows, kMapDistance);
  UncertaintyMap map;
  map.seconds = watch.Seconds();
  for (int row = 0; row < kMapRows; ++row) {
    for (int col = 0; col < kMapCols; ++col) map.sigma_px.push_back(sigmas(row, col));
  }
  return map;
}

/// 2-D root mean square over the corners that were kept, and how many were not.
void Measure(Solution* solution) {
  const auto residuals = calib::BundleResiduals(solution->views, solution->state);
  double sum = 0;
  calib::BundleReport& report = solution->report;
  report.num_corners = report.num_rejected = 0;
  for (size_t v = 0; v < residuals.size(); ++v) {
    for (Eigen::Index i = 0; i < residuals[v].cols(); ++i) {
      const bool kept = solution->views[v].weights[i] > 0;
      kept ? ++report.num_corners : ++report.num_rejected;
      if (kept) sum += residuals[v].col(i).squaredNorm();
    }
  }
  report.rms_px = std::sqrt(sum / report.num_corners);
}

/// Largest distance between the projections of all corners by two solutions, px.
double LargestDifference(const Solution& a, const Solution& b) {
  const auto of_a = calib::BundleResiduals(a.views, a.state), of_b = calib::BundleResiduals(b.views, b.state);
  double largest = 0;
  for (size_t v = 0; v < of_a.size(); ++v) largest = std::max(largest, (of_a[v] - of_b[v]).colwise().norm().maxCoeff());
  return largest;
}

class Table {
 public:
  Table() {
    std::printf("%-34s %-22s %9s %9s %9s %9s %10s %7s\n", "problem", "method", "rms px", "rejected", "warp mm", "differ px",
                "seconds", "ratio");
  }
  void Add(const std::string& problem, const std::string& method, const Solution& solution, const Solution& peer) {
    const calib::BundleReport& report = solution.report;
    const double difference = &solution == &peer ? 0 : LargestDifference(solution, peer);
    const double warp_mm = 1e3 * solution.state.board_warp_m[0].x(), ratio = solution.seconds / peer.seconds;
    std::printf("%-34s %-22s %9.5f %9d %9.4f %9.1e %10.3f %7.2f\n", problem.c_str(), method.c_str(), report.rms_px,
                report.num_rejected, warp_mm, difference, solution.seconds, ratio);
    rows_.push_back({{"problem", problem},
                     {"method", method},
                     {"status", std::string(ToString(report.status))},
                     {"rms_px", report.rms_px},
                     {"num_corners", report.num_corners},
                     {"num_rejected", report.num_rejected},
                     {"board_warp_mm", {1e3 * solution.state.board_warp_m[0].x(), 1e3 * solution.state.board_warp_m[0].y()}},
                     {"max_difference_px", difference},
                     {"seconds", solution.seconds},
                     {"ratio", ratio}});
  }
  void AddMap(const std::string& problem, const std::string& method, UncertaintyMap map, double peer_seconds,
              double difference) {
    const double largest = *std::max_element(map.sigma_px.begin(), map.sigma_px.end());
    const double median = UpperMedian(map.sigma_px.begin(), map.sigma_px.end());
    std::printf("%-34s %-22s median %.4f px, largest %.4f px, differ %7.1e %7.3f %7.2f\n", problem.c_str(), method.c_str(),
                median, largest, difference, map.seconds, map.seconds / peer_seconds);
    rows_.push_back({{"problem", problem},
                     {"method", method},
                     {"median_sigma_px", median},
                     {"max_sigma_px", largest},
                     {"max_relative_difference", difference},
                     {"seconds", map.seconds},
                     {"ratio", map.seconds / peer_seconds}});
  }
  const nlohmann::ordered_json& rows() const { return rows_; }

 private:
  nlohmann::ordered_json rows_ = nlohmann::ordered_json::array();
};

std::string Name(const RigScene& scene, const std::string& what) {
  return std::to_string(scene.truth.cameras.size()) + " cameras, " + std::to_string(scene.num_corners) + " corners" + what;
}

void BenchSize(const Size& size, uint64_t seed, Table* table) {
  const RigScene scene = MakeRigScene(size.cameras, size.corners, kNoisePx, seed);
  const int threads = ResolveThreads(0);
  calib::BundleOptions options;
  options.refine_warp = true;
  for (bool reject : {true, false}) {
    options.reject_outliers = reject;
    const std::string name = Name(scene, reject ? ", rejecting" : "");
    Solution peer = SolveByMrcal(scene, options), single = SolveByUs(scene, options, 1),
             all = SolveByUs(scene, options, threads);
    for (int i = 1; i < kRepeats; ++i) {
      peer.seconds = std::min(peer.seconds, SolveByMrcal(scene, options).seconds);
      single.seconds = std::min(single.seconds, SolveByUs(scene, options, 1).seconds);
      all.seconds = std::min(all.seconds, SolveByUs(scene, options, threads).seconds);
    }
    for (Solution* solution : {&peer, &single, &all}) Measure(solution);
    table->Add(name, "mrcal_optimize", peer, peer);
    table->Add(name, "mvstudio, 1 thread", single, peer);
    table->Add(name, "mvstudio, " + std::to_string(threads) + " threads", all, peer);
    if (reject) continue;
    const UncertaintyMap map = MapByMrcal(peer, scene.board, options, 0, kMapCols, kMapRows, kMapDistance, kNoisePx);
    const UncertaintyMap ours = MapByUs(peer, options, threads);
    double difference = 0;
    for (size_t i = 0; i < map.sigma_px.size(); ++i)
      difference = std::max(difference, std::abs(ours.sigma_px[i] / map.sigma_px[i] - 1));
    table->AddMap(Name(scene, ", 12x8 map"), "mrcal's way", map, map.seconds, 0);
    table->AddMap(Name(scene, ", 12x8 map"), "mvstudio, " + std::to_string(threads) + " threads", ours, map.seconds,
                  difference);
  }
}

}  // namespace
}  // namespace mvstudio::bench

/// bench_calibration [SEED] [JSON FILE or -] [LARGEST NUMBER OF CAMERAS]
int main(int argc, char** argv) {
  using namespace mvstudio::bench;
  const uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1;
  const int largest = argc > 3 ? std::atoi(argv[3]) : 1000;
  Table table;
  for (const Size& size : kSizes) {
    if (size.cameras <= largest) BenchSize(size, seed, &table);
  }
  if (argc > 2 && std::string(argv[2]) != "-")
    std::ofstream(argv[2]) << nlohmann::ordered_json{{"seed", seed}, {"rows", table.rows()}}.dump(1) << "\n";
  return 0;
}
