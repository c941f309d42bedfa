#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>
#include <iostream>
#include <sstream>
#include <string>

#include "avatar/set_distance.h"
#include "core/npy.h"

/// bench_avatar_distance: the timed side of bench/metrics_beside_peers.py, like bench_metrics:
///   load A.npy B.npy    features (n, d); answers "ok"
///   frechet THREADS     answers "VALUE SECONDS CPU_SECONDS"
namespace mvstudio {
namespace {

at::Tensor ReadFeatures(const std::string& path) {
  const NpyArray array = ReadNpy(path);
  return at::tensor(array.values, at::kDouble).view(array.shape);
}

int Serve() {
  at::Tensor a, b;
  std::string line, what, first, second;
  while (std::getline(std::cin, line)) {
    std::istringstream(line) >> what >> first >> second;
    if (what == "load") {
      a = ReadFeatures(first), b = ReadFeatures(second);
      std::printf("ok\n");
    } else if (what == "frechet") {
      at::set_num_threads(std::stoi(first));
      const std::clock_t cpu = std::clock();
      const auto start = std::chrono::steady_clock::now();
      const double value = avatar::FrechetDistance(a, b);
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      std::printf("%.17g %.9f %.9f\n", value, seconds.count(), static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC);
    } else {
      std::fprintf(stderr, "bench_avatar_distance: unknown request: %s\n", line.c_str());
      return 2;
    }
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace mvstudio

int main() {
  try {
    return mvstudio::Serve();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_avatar_distance: %s\n", error.what());
    return 1;
  }
}
