#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include "avatar/scores/set_distance.h"
#include "bench/requests.h"
#include "core/disk/npy.h"

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
  return bench::Answer("bench_avatar_distance", {{"load",
                                                  [&](std::istringstream& words) {
                                                    a = ReadFeatures(bench::Word(words)), b = ReadFeatures(bench::Word(words));
                                                    std::printf("ok\n");
                                                  }},
                                                 {"frechet", [&](std::istringstream& words) {
                                                    at::set_num_threads(bench::Number(words));
                                                    bench::PrintTimed([&] { return avatar::FrechetDistance(a, b); });
                                                  }}});
}

}  // namespace
}  // namespace mvstudio

int main() { return mvstudio::Serve(); }
