#include "avatar/lift/lift.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>

#include "avatar/data/safetensors.h"
#include "avatar/train/adam.h"
#include "core/check.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/units.h"

namespace mvstudio::avatar {
namespace {

constexpr char kFormat[] = "mvstudio.lifter/1";

std::string Layer(int i) { return "layer" + std::to_string(i); }

/// First layer, two for each block, last layer.
int NumLayers(const LiftOptions& o) { return 2 * o.blocks + 2; }

std::pair<int64_t, int64_t> LayerSize(const LiftOptions& o, int i) {
  const int64_t in = i == 0 ? kLiftInputs : o.width, out = i + 1 == NumLayers(o) ? kNumJoints * 3 : o.width;
  return {out, in};
}

at::Tensor Apply(const Lifter& lifter, int i, const at::Tensor& x) {
  return at::linear(x, lifter.weights.at(Layer(i) + ".weight"), lifter.weights.at(Layer(i) + ".bias"));
}

at::Tensor Forward(const Lifter& lifter, const at::Tensor& inputs) {
  at::Tensor x = at::relu(Apply(lifter, 0, inputs));
  for (int b = 0; b < lifter.options.blocks; ++b) {
    x = x + at::relu(Apply(lifter, 2 * b + 2, at::relu(Apply(lifter, 2 * b + 1, x))));
  }
  return Apply(lifter, NumLayers(lifter.options) - 1, x).reshape({-1, kNumJoints, 3});
}

struct LiftBatch {
  at::Tensor input, target, weight;
};

LiftBatch MakeBatch(const LiftSampler& sampler, const RunContext& run, int batch, int step) {
  LiftBatch b = {at::zeros({batch, kLiftInputs}), at::zeros({batch, kNumJoints, 3}), at::zeros({batch, kNumJoints})};
  float *input = b.input.data_ptr<float>(), *target = b.target.data_ptr<float>(), *weight = b.weight.data_ptr<float>();
  ParallelFor(batch, ResolveThreads(run.num_threads), [&](int64_t i) {
    sampler(static_cast<uint64_t>(step) * static_cast<uint64_t>(batch) + static_cast<uint64_t>(i), input + i * kLiftInputs,
            target + i * kNumJoints * 3, weight + i * kNumJoints);
  });
  return b;
}

/// Mean distance over the joints that are known.
at::Tensor Distance(const at::Tensor& joints, const LiftBatch& batch) {
  const at::Tensor distance = ((joints - batch.target).square().sum(2) + 1e-12).sqrt();
  return (distance * batch.weight).sum() / batch.weight.sum().clamp_min(1);
}

double Number(const TensorFile& file, const std::string& path, const std::string& key) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) throw FormatError(path, "__metadata__." + key, "is missing: not a lifter");
  std::istringstream in(found->second);
  in.imbue(std::locale::classic());
  double value = 0;
  in >> value;
  if (in.fail() || !in.eof() || !std::isfinite(value)) {
    throw FormatError(path, "__metadata__." + key, "'" + found->second + "' is not a number");
  }
  return value;
}

LiftOptions OptionsOf(const TensorFile& file, const std::string& path) {
  LiftOptions options;
  options.width = static_cast<int>(Number(file, path, "width"));
  options.blocks = static_cast<int>(Number(file, path, "blocks"));
  try {
    Validate(options);
  } catch (const UsageError& error) {
    throw FormatError(path, "__metadata__", error.what());
  }
  return options;
}

void Check(bool fine, const std::string& option, const std::string& range) {
  if (!fine) throw UsageError("option '" + option + "' must be " + range);
}

}  // namespace

void Validate(const LiftOptions& o) {
  Check(o.width >= 8 && o.width <= 8192, "width", "8 to 8192");
  Check(o.blocks >= 0 && o.blocks <= 16, "blocks", "0 to 16");
  Check(o.steps >= 0, "steps", "0 or more");
  Check(o.batch >= 1 && o.batch <= 65536, "batch", "1 to 65536");
  Check(o.learning_rate >= 0 && o.learning_rate <= 0.1, "learning-rate", "0 to 0.1");
  Check(o.clip_norm >= 0 && std::isfinite(o.clip_norm), "clip-norm", "0 or more");
}

Lifter MakeLifter(const LiftOptions& options, uint64_t seed) {
  Validate(options);
  Lifter lifter;
  lifter.options = options;
  Rng rng(seed);
  for (int i = 0; i < NumLayers(options); ++i) {
    const auto [out, in] = LayerSize(options, i);
    const at::Tensor weight = at::empty({out, in});
    const double scale = std::sqrt(2.0 / static_cast<double>(in)) * (i + 1 == NumLayers(options) ? 0.1 : 1);
    float* values = weight.data_ptr<float>();
    for (int64_t k = 0; k < out * in; ++k) values[k] = static_cast<float>(scale * rng.Normal());
    lifter.weights[Layer(i) + ".weight"] = weight;
    lifter.weights[Layer(i) + ".bias"] = at::zeros({out});
  }
  return lifter;
}

at::Tensor Lift(const Lifter& lifter, const at::Tensor& inputs) {
  MVS_CHECK(inputs.dim() == 2 && inputs.size(1) == kLiftInputs, "inputs are " << inputs.sizes());
  return Forward(lifter, inputs);
}

LiftReport TrainLifter(const LiftSampler& sampler, const RunContext& run, Lifter* lifter) {
  const LiftOptions& o = lifter->options;
  at::set_num_threads(ResolveThreads(run.num_threads));
  Adam adam;
  for (auto& [name, weight] : lifter->weights) adam.Add(name, weight.set_requires_grad(true));
  ProgressStage stage(run, "learning to lift", o.steps);
  LiftReport report;
  double sum = 0;
  int count = 0;
  for (int step = 0; step < o.steps; ++step) {
    const LiftBatch batch = MakeBatch(sampler, run, o.batch, step);
    const at::Tensor loss = Distance(Forward(*lifter, batch.input), batch);
    adam.ClearGradients();
    loss.backward();
    const double norm = adam.GradientNorm();
    if (!std::isfinite(loss.item<double>()) || !std::isfinite(norm)) {
      report.status = Status::kNonFiniteInput;
      break;
    }
    if (o.clip_norm > 0 && norm > o.clip_norm) adam.ScaleGradients(o.clip_norm / norm);
    adam.Step(o.learning_rate * (0.02 + 0.98 * 0.5 * (1 + std::cos(kPi * step / o.steps))));
    sum += loss.item<double>(), ++count, ++report.steps_done;
    const bool due = (step + 1) % 100 == 0 || step + 1 == o.steps;
    if (due) report.losses.emplace_back(step + 1, sum / count), sum = 0, count = 0;
    stage.Advance(1, due ? "mean distance " + std::to_string(report.losses.back().second) + " sizes" : "");
  }
  adam.ClearGradients();
  for (auto& [name, weight] : lifter->weights) weight = weight.detach();
  return report;
}

void SaveLifter(const Lifter& lifter, const std::string& path) {
  TensorFile file;
  file.tensors = lifter.weights;
  file.metadata = {{"format", kFormat},
                   {"width", std::to_string(lifter.options.width)},
                   {"blocks", std::to_string(lifter.options.blocks)},
                   {"size_m", Format("%.17g", lifter.size_m)},
                   {"sigma_m", Format("%.17g", lifter.sigma_m)}};
  WriteTensorFile(file, path);
}

Lifter LoadLifter(const std::string& path) {
  TensorFile file = ReadTensorFile(path);
  const auto format = file.metadata.find("format");
  if (format == file.metadata.end() || format->second != kFormat) {
    throw FormatError(path, "__metadata__.format", "is not a lifter; `mvstudio avatar lift train` makes one");
  }
  Lifter lifter;
  lifter.options = OptionsOf(file, path);
  lifter.size_m = Number(file, path, "size_m");
  lifter.sigma_m = Number(file, path, "sigma_m");
  if (!(lifter.size_m > 0)) throw FormatError(path, "__metadata__.size_m", "is not positive");
  for (int i = 0; i < NumLayers(lifter.options); ++i) {
    const auto [out, in] = LayerSize(lifter.options, i);
    for (const std::string kind : {".weight", ".bias"}) {
      const std::string name = Layer(i) + kind;
      const auto found = file.tensors.find(name);
      if (found == file.tensors.end()) throw FormatError(path, name, "is missing");
      const at::Tensor& value = found->second;
      const std::vector<int64_t> shape = kind == ".bias" ? std::vector<int64_t>{out} : std::vector<int64_t>{out, in};
      if (value.sizes() != at::IntArrayRef(shape) || value.scalar_type() != at::kFloat) {
        throw FormatError(path, name, "has another size or type than the network");
      }
      if (!at::isfinite(value).all().item<bool>()) throw FormatError(path, name, "holds numbers that are not finite");
      lifter.weights[name] = value;
    }
  }
  return lifter;
}

}  // namespace mvstudio::avatar
