#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "avatar/data/pack.h"
#include "core/fields.h"
#include "core/progress.h"
#include "core/status.h"

namespace mvstudio::avatar {

inline constexpr int64_t kLiftFrames = 5;  ///< neighbouring frames that the network sees; its output is for the middle one
/// x, y and confidence of each joint in each frame, then log of the person's angular size, then sine and presence of the
/// pitch.
inline constexpr int64_t kLiftInputs = kLiftFrames * kNumJoints * 3 + 3;

/// The lifting network and its training.
struct LiftOptions {
  int width = 512;
  int blocks = 2;
  int steps = 3000;
  int batch = 128;
  double learning_rate = 1e-3;
  double clip_norm = 1.0;
};

template <class Visitor>
void VisitFields(Visitor&& visit, LiftOptions& o) {
  visit("width", o.width, "channels of the hidden layers");
  visit("blocks", o.blocks, "residual blocks of two layers each");
  visit("steps", o.steps, "training steps");
  visit("batch", o.batch, "poses per step");
  visit("learning-rate", o.learning_rate, "Adam step at the beginning; falls to 2 % along a cosine");
  visit("clip-norm", o.clip_norm, "gradients with a larger norm are clipped; 0: never");
}

/// Throws UsageError naming the option.
void Validate(const LiftOptions& options);

/// A multi-layer perceptron from 2D joints of five frames to 3D joints of the middle one, as used by Shysheya et al., CVPR
/// 2019, for video of a single camera (theirs predicts the last frame). Residual as in Martinez et al., ICCV 2017. Its
/// coordinates are those of avatar/run/lift/lift_input.h.
struct Lifter {
  LiftOptions options;
  std::map<std::string, at::Tensor> weights;  ///< float32, "layer0.weight" …
  double size_m = 0;                          ///< of the people it was trained on: trunk + thigh + shank, metres
  double sigma_m = 0;                         ///< root mean square error of a coordinate on held-out frames, metres; 0: unknown
};

/// New weights, normal with variance 2 / inputs (He et al. 2015), the last layer a tenth of it.
Lifter MakeLifter(const LiftOptions& options, uint64_t seed);

/// inputs (N, kLiftInputs) float32 -> (N, 19, 3) joints relative to the middle of the hips, in units of the person's size.
/// On the weights' device and in their type; gradients reach weights that require them.
at::Tensor Lift(const Lifter& lifter, const at::Tensor& inputs);

/// Writes training sample `index`: kLiftInputs inputs, 19 x 3 targets, 19 weights (0: joint unknown). Must depend only on
/// `index`.
using LiftSampler = std::function<void(uint64_t index, float* input, float* target, float* weight)>;

struct LiftReport {
  Status status = Status::kOk;  ///< kNonFiniteInput when a loss was not finite; the weights are those of the previous step
  int steps_done = 0;
  std::vector<std::pair<int, double>> losses;  ///< step, mean distance of the joints since the previous row, in sizes
};

/// Adam on the mean distance of the joints; samples are functions of (seed, step) alone. Sets the number of threads of ATen.
LiftReport TrainLifter(const LiftSampler& sampler, const RunContext& run, Lifter* lifter);

/// A safetensors file with a digest for each tensor. LoadLifter throws IoError, or FormatError naming the invalid part.
void SaveLifter(const Lifter& lifter, const std::string& path);
Lifter LoadLifter(const std::string& path);

}  // namespace mvstudio::avatar
