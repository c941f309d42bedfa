#include "bench/gpu/times.h"

#include <ATen/ATen.h>
#include <c10/util/Exception.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "avatar/train/train.h"
#include "bench/gpu/device.h"
#include "bench/gpu/learner.h"
#include "core/statistics.h"

namespace mvstudio::avatar {
namespace {

constexpr int kWarmUp = 2, kTimed = 5;

struct Cost {
  double seconds = std::nan("");
  int64_t peak = 0;
};

/// Median of some steps after others; NaN when the memory does not suffice.
Cost StepCost(Learner* learner, bool half, bool tf32, const at::Device& device) try {
  AllowTf32(tf32);
  ResetPeakMemory(device);
  std::vector<double> seconds;
  for (int k = 0; k < kWarmUp + kTimed; ++k) {
    const double took = Seconds([&] { learner->Gradients(half), learner->Move(), Synchronise(device); });
    if (k >= kWarmUp) seconds.push_back(took);
  }
  return {LinearQuantile(seconds, 0.5), PeakMemory(device)};
} catch (const c10::Error&) {
  return {};
}

std::string Memory(int64_t bytes) { return bytes > 0 ? Fixed(static_cast<double>(bytes) / 1e9, 2) : "not known"; }

void AddCost(const Cost& cost, int64_t batch, std::vector<std::string>* cells) {
  const bool known = std::isfinite(cost.seconds);
  cells->push_back(known ? Fixed(1e3 * cost.seconds, 1) : "no memory");
  cells->push_back(known ? Fixed(static_cast<double>(batch) / cost.seconds, 1) : "-");
  cells->push_back(known ? Memory(cost.peak) : "-");
}

double RenderSeconds(const Net& net, const AvatarPack& pack, const at::Device& device) {
  Learner learner(net, pack, 1, device, at::kFloat);
  const PoseBatch pose = PosesOf(pack, at::zeros({1}, at::kLong));
  std::vector<double> seconds;
  for (int k = 0; k < kWarmUp + kTimed; ++k) {
    const double took = Seconds([&] { Render(learner.model(), pose, net.size_px, net.size_px); });
    if (k >= kWarmUp) seconds.push_back(took);
  }
  return LinearQuantile(seconds, 0.5);
}

void TimeNet(const Net& net, const std::vector<int64_t>& batches, const at::Device& device, Report* report) {
  const AvatarPack pack = PackFor(net, *std::max_element(batches.begin(), batches.end()));
  const int64_t parameters = Learner(net, pack, 1, at::Device(at::kCPU), at::kFloat).parameters();
  for (const int64_t batch : batches) {
    if (!report->TimeFor("steps of " + net.name)) return;
    std::vector<std::string> cells = {net.name, std::to_string(parameters), std::to_string(batch)};
    Learner learner(net, pack, batch, device, at::kFloat);
    if (device.is_cuda()) AddCost(StepCost(&learner, false, false, device), batch, &cells), cells.pop_back();
    AddCost(StepCost(&learner, false, true, device), batch, &cells);
    if (device.is_cuda()) AddCost(StepCost(&learner, true, true, device), batch, &cells);
    cells.push_back(batch == batches.front() ? Fixed(1e3 * RenderSeconds(net, pack, device), 1) : "");
    report->Row(cells);
  }
}

/// A training by Trainer, as `avatar train` runs it.
struct Training {
  TrainReport report;
  TensorFile end;
  double first = std::nan(""), last = std::nan("");  // mean losses of the end-to-end steps
  double seconds_per_step = 0;
};

Training Train(const Net& net, const AvatarPack& pack, const Schedule& schedule, int steps, bool half,
               const at::Device& device) {
  TrainOptions options;
  options.steps = steps, options.batch = schedule.batch, options.validate_images = 0;
  options.init_steps = net.options.prior == Prior::kNone && net.options.method == Method::kTna ? steps / 3 : 0;
  options.report_every = std::max(1, steps / 10);
  options.critic_width = net.critic_width;
  options.device = device.is_cuda() ? "cuda" : "cpu", options.amp = half;
  RunContext run;
  run.num_threads = schedule.num_threads;
  Training out;
  Trainer trainer(pack, net.options, options, run);
  const double seconds = Seconds([&] { out.report = trainer.Run(nullptr, {}), Synchronise(device); });
  for (const HistoryRow& row : out.report.history) {
    if (row.phase != "train") continue;
    if (std::isnan(out.first)) out.first = row["total"];
    out.last = row["total"];
  }
  out.end = trainer.Checkpoint();
  out.seconds_per_step = seconds / static_cast<double>(std::max<int64_t>(1, out.report.steps_done));
  return out;
}

/// Of the network's weights, relative to their length; 0: the same bytes.
double Distance(const TensorFile& a, const TensorFile& b) {
  double off = 0, length = 0;
  for (const auto& [name, tensor] : a.tensors) {
    if (name.rfind("generator.", 0) != 0 || tensor.scalar_type() != at::kFloat) continue;
    off += (b.tensors.at(name) - tensor).square().sum().item<double>(), length += tensor.square().sum().item<double>();
  }
  return std::sqrt(off / length);
}

/// Its row, judged: the loss must be finite and fall, half precision must end as `single` does.
void AddRow(const Net& net, const Training& t, const Training* single, const std::string& apart, int steps, Report* report) {
  // The loss of a generator and its discriminator does not settle.
  const double half_over_single = net.options.method == Method::kV2v ? 0.3 : 0.15;
  const double most = steps >= 100 ? 0.9 : 1.0, fall = t.last / t.first;
  const double beside = single ? std::abs(t.last / single->last - 1) : 0;
  const bool fine = t.report.status == Status::kOk && fall < most && beside <= half_over_single;
  report->Row({net.name, single ? "half" : "float32", Fixed(t.first, 3), Fixed(t.last, 3), Fixed(fall, 3), Fixed(most, 1),
               single ? Scientific(beside) : "", single ? Fixed(half_over_single, 2) : "", Fixed(1e3 * t.seconds_per_step, 1),
               apart, report->Verdict(fine)});
}

}  // namespace

void TimeSteps(const std::vector<Net>& nets, const std::vector<int64_t>& batches, const at::Device& device, Report* report) {
  std::vector<std::string> columns = {"network", "parameters", "batch"};
  if (device.is_cuda()) columns.insert(columns.end(), {"float32: ms", "images/s"});
  columns.insert(columns.end(), {device.is_cuda() ? "TF32: ms" : "float32: ms", "images/s", "peak GB"});
  if (device.is_cuda()) columns.insert(columns.end(), {"half: ms", "images/s", "peak GB"});
  columns.push_back("render: ms");
  report->Table("A training step:", columns);
  for (const Net& net : nets) TimeNet(net, batches, device, report);
}

void TrainNets(const std::vector<Net>& nets, const Schedule& schedule, const at::Device& device, Report* report) {
  constexpr int kEqualSteps = 25;
  AllowTf32(true);
  report->Table(
      "Trainings of " + std::to_string(schedule.steps) + " steps, " + std::to_string(schedule.batch) + " images each:",
      {"network", "precision", "first loss", "last", "ratio", "below", "beside float32", "at most", "ms a step",
       "equal runs part by", ""});
  for (const Net& net : nets) {
    if (!report->TimeFor("trainings of " + net.name)) continue;
    const AvatarPack pack = PackFor(net, 16);
    const auto train = [&](int steps, bool half) { return Train(net, pack, schedule, steps, half, device); };
    const int few = std::min(schedule.steps, kEqualSteps);
    const Training single = train(schedule.steps, false), one = train(few, false), same = train(few, false);
    AddRow(net, single, nullptr, Scientific(Distance(one.end, same.end)), schedule.steps, report);
    if (device.is_cuda()) AddRow(net, train(schedule.steps, true), &single, "", schedule.steps, report);
  }
}

}  // namespace mvstudio::avatar
