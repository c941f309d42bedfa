#include <ATen/Parallel.h>
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <map>
#include <string>
#include <thread>

#include "avatar/train/train.h"
#include "bench/gpu/checks.h"
#include "bench/gpu/device.h"
#include "bench/gpu/nets.h"
#include "bench/gpu/report.h"
#include "bench/gpu/times.h"
#include "core/error.h"

/// bench_gpu [device auto|cpu|cuda] [size small|full] [part all|checks|times|trainings] [net NAME] [steps N] [seconds N]
/// [machine TEXT] [spoil SHARE]: the avatar networks on a device beside the CPU in double, what their steps cost, and short
/// trainings, as one Markdown page (scripts/gpu-check). The exit code: 1 when a check is off or something was left out for want
/// of time, 2 for other arguments.
namespace mvstudio::avatar {
namespace {

struct Settings {
  std::string device = "auto", size = "full", part = "all", net, machine = "not named";
  int steps = 100;
  double seconds = 420, spoil = 0;
};

Settings Parse(int argc, char** argv) {
  Settings s;
  const std::map<std::string, std::string*> texts = {
      {"device", &s.device}, {"size", &s.size}, {"part", &s.part}, {"net", &s.net}, {"machine", &s.machine}};
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    const auto text = texts.find(name);
    if (text != texts.end())
      *text->second = value;
    else if (name == "steps")
      s.steps = std::stoi(value);
    else if (name == "seconds")
      s.seconds = std::stod(value);
    else if (name == "spoil")
      s.spoil = std::stod(value);
    else
      throw UsageError("argument '" + name + "' is not known");
  }
  if (argc % 2 == 0) throw UsageError("argument '" + std::string(argv[argc - 1]) + "' has no value");
  if (s.size != "small" && s.size != "full") throw UsageError("size is small or full");
  if (s.part != "all" && s.part != "checks" && s.part != "times" && s.part != "trainings")
    throw UsageError("part is all, checks, times or trainings");
  return s;
}

/// All, or the one that is named.
std::vector<Net> Chosen(std::vector<Net> nets, const std::string& name) {
  if (name.empty()) return nets;
  nets.erase(std::remove_if(nets.begin(), nets.end(), [&](const Net& net) { return net.name != name; }), nets.end());
  if (nets.empty()) throw UsageError("no network is called '" + name + "'");
  return nets;
}

void RunChecks(const Settings& s, const at::Device& device, Report* report) {
  report->Table("Checks, beside the CPU in double:", {"network", "what", "error", "bound", ""});
  AllowTf32(false);
  CheckLifter(device, report);
  CheckAdam(device, report);
  CheckNets(Chosen(SmallNets(), s.net), device, s.spoil, report);
  if (s.size != "full") return;
  for (const Net& net : Chosen(FullNets(), s.net)) {  // the others are made of the same layers
    const bool by_default = net.name == "TNA" || net.name == "HF";
    if (by_default || !s.net.empty()) CheckNets({net}, device, s.spoil, report);
  }
}

int Run(const Settings& s) {
  const bool full = s.size == "full";
  const auto wanted = [&](const char* part) { return s.part == "all" || s.part == part; };
  const at::Device device(ResolveDevice(s.device));
  at::set_num_threads(full ? static_cast<int>(std::thread::hardware_concurrency()) : 1);
  const std::vector<Net> nets = Chosen(full ? FullNets() : SmallNets(), s.net);
  Report report(s.seconds);
  report.Line("Device: " + device.str() + ", " + s.machine + "; libtorch " + LibtorchVersion() + ".");
  if (wanted("checks")) RunChecks(s, device, &report);
  if (wanted("times")) TimeSteps(nets, full ? std::vector<int64_t>{1, 4, 16} : std::vector<int64_t>{2}, device, &report);
  if (wanted("trainings")) TrainNets(nets, {s.steps, 2, full ? 0 : 1}, device, &report);
  report.Line("\n" + std::to_string(report.checks()) + " checks, " + std::to_string(report.failed()) + " off" +
              (report.complete() ? "." : "; some were left out for want of time."));
  return report.failed() == 0 && report.complete() ? 0 : 1;
}

}  // namespace
}  // namespace mvstudio::avatar

int main(int argc, char** argv) try {
  // As mvstudio's own main does.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  return mvstudio::avatar::Run(mvstudio::avatar::Parse(argc, argv));
} catch (const mvstudio::UsageError& error) {
  std::fprintf(stderr, "bench_gpu: %s\n", error.what());
  return 2;
} catch (const std::exception& error) {
  std::fprintf(stderr, "bench_gpu: %s\n", error.what());
  return 1;
}
