#include "avatar/metrics/ssim.h"
#include "bench/requests.h"
#include "core/disk/npy.h"
#include "core/image.h"

/// bench_metrics: the timed side of bench/metrics_beside_peers.py. Its requests:
///   load A.npy B.npy            two images (H, W, C) of 8 bits; answers "ok"
///   ssim wang|uniform THREADS   from 8 bits to the score; answers "VALUE SECONDS CPU_SECONDS"
namespace mvstudio {
namespace {

Image ReadScoredImage(const std::string& path) {
  const NpyArray array = ReadNpy(path);
  Image image(static_cast<int>(array.shape.at(1)), static_cast<int>(array.shape.at(0)), static_cast<int>(array.shape.at(2)));
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(array.values[i]);
  return image;
}

int Serve() {
  Image a, b;
  return bench::Answer("bench_metrics", {{"load",
                                          [&](std::istringstream& words) {
                                            a = ReadScoredImage(bench::Word(words)), b = ReadScoredImage(bench::Word(words));
                                            std::printf("ok\n");
                                          }},
                                         {"ssim", [&](std::istringstream& words) {
                                            const auto window = bench::Word(words) == "wang" ? metrics::SsimWindow::kWang2004
                                                                                             : metrics::SsimWindow::kUniform7;
                                            const int threads = bench::Number(words);
                                            bench::PrintTimed([&] { return metrics::Ssim(a, b, window, threads).value; });
                                          }}});
}

}  // namespace
}  // namespace mvstudio

int main() { return mvstudio::Serve(); }
