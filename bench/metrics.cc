#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>
#include <iostream>
#include <sstream>
#include <string>

#include "core/image.h"
#include "core/npy.h"
#include "metrics/ssim.h"

/// bench_metrics: the timed side of bench/metrics_beside_peers.py. Reads one request a line and answers each with one line, so
/// that two programs can be timed in turns:
///   load A.npy B.npy            two pictures (H, W, C) of 8 bits; answers "ok"
///   ssim wang|uniform THREADS   from 8 bits to the score; answers "VALUE SECONDS CPU_SECONDS"
namespace mvstudio {
namespace {

Image ReadPicture(const std::string& path) {
  const NpyArray array = ReadNpy(path);
  Image image(static_cast<int>(array.shape.at(1)), static_cast<int>(array.shape.at(0)), static_cast<int>(array.shape.at(2)));
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(array.values[i]);
  return image;
}

void TimeSsim(const Image& a, const Image& b, const std::string& kind, int threads) {
  const auto window = kind == "wang" ? metrics::SsimWindow::kWang2004 : metrics::SsimWindow::kUniform7;
  const std::clock_t cpu = std::clock();
  const auto start = std::chrono::steady_clock::now();
  const double value = metrics::Ssim(a, b, window, threads).value;
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  const double cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  std::printf("%.17g %.9f %.9f\n", value, seconds.count(), cpu_seconds);
}

int Serve() {
  Image a, b;
  std::string line, what, first, second;
  while (std::getline(std::cin, line)) {
    std::istringstream(line) >> what >> first >> second;
    if (what == "load") {
      a = ReadPicture(first), b = ReadPicture(second);
      std::printf("ok\n");
    } else if (what == "ssim") {
      TimeSsim(a, b, first, std::stoi(second));
    } else {
      std::fprintf(stderr, "bench_metrics: unknown request: %s\n", line.c_str());
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
    std::fprintf(stderr, "bench_metrics: %s\n", error.what());
    return 1;
  }
}
