#include "avatar/train/adam.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <malloc.h>
#include <torch/optim/adam.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "avatar/nets/model.h"
#include "core/statistics.h"

/// avatar::Adam beside torch::optim::Adam on the tensors of whole models, in turns, either of them first in every second step:
/// milliseconds of processor time a step (all threads), and how far both are from the same steps in double precision.
/// bench_adam [STEPS] [NUMBER OF MODELS, the smallest first]
namespace mvstudio::avatar {
namespace {

constexpr double kLearningRate = 1e-3;

struct Case {
  const char* name;
  ModelOptions options;
  int size_px;
};

std::vector<Case> Cases() {
  ModelOptions small, direct;
  small.width = 8;
  direct.method = Method::kDirect;
  return {{"tna, width 8, 64 px", small, 64},
          {"tna, width 16, 128 px", {}, 128},
          {"direct, width 16, 128 px", direct, 128},
          {"tna, the paper's, 512 px", PaperModel(), 512}};
}

std::vector<at::Tensor> Weights(const Case& c) {
  const AvatarModel model = MakeModel(c.options, c.size_px, {-0.5, 0.5}, 1);
  std::vector<at::Tensor> weights = model.generator->parameters();
  if (model.textures.defined()) weights.push_back(model.textures.detach().clone().requires_grad_());
  return weights;
}

std::vector<at::Tensor> Copies(const std::vector<at::Tensor>& tensors) {
  std::vector<at::Tensor> copies;
  for (const at::Tensor& t : tensors) copies.push_back(t.detach().clone().requires_grad_());
  return copies;
}

/// Gradients as small as those of a trained network, a tenth of them zero as those of hidden texels.
std::vector<at::Tensor> RandomGradients(const std::vector<at::Tensor>& tensors) {
  at::manual_seed(1);
  std::vector<at::Tensor> gradients;
  for (const at::Tensor& t : tensors) gradients.push_back(1e-3 * at::randn(t.sizes()) * (at::rand(t.sizes()) > 0.1));
  return gradients;
}

/// They grow, shrink and change sign from step to step.
void SetGradients(const std::vector<at::Tensor>& gradients, int step, const std::vector<at::Tensor>& a,
                  const std::vector<at::Tensor>& b) {
  for (size_t i = 0; i < gradients.size(); ++i)
    a[i].mutable_grad() = b[i].mutable_grad() = gradients[i] * std::cos(step + 0.1 * static_cast<double>(i));
}

/// Kingma and Ba's algorithm 1 in double precision.
class Reference {
 public:
  explicit Reference(const std::vector<at::Tensor>& start) {
    for (const at::Tensor& t : start) values.push_back(t.detach().to(at::kDouble));
    for (const at::Tensor& t : values) first_.push_back(at::zeros_like(t)), second_.push_back(at::zeros_like(t));
  }

  void Step(const std::vector<at::Tensor>& with_gradients) {
    ++step_;
    for (size_t i = 0; i < values.size(); ++i) {
      const at::Tensor g = with_gradients[i].grad().to(at::kDouble);
      first_[i].mul_(0.9).add_(g, 0.1), second_[i].mul_(0.999).addcmul_(g, g, 0.001);
      const at::Tensor m = first_[i] / (1 - std::pow(0.9, step_)), v = second_[i] / (1 - std::pow(0.999, step_));
      values[i] -= kLearningRate * m / (v.sqrt() + 1e-8);
    }
  }

  /// Largest distance of the values, in learning rates.
  double Distance(const std::vector<at::Tensor>& others) const {
    double largest = 0;
    for (size_t i = 0; i < values.size(); ++i)
      largest = std::max(largest, (values[i] - others[i].detach()).abs().max().item<double>() / kLearningRate);
    return largest;
  }

  std::vector<at::Tensor> values;

 private:
  std::vector<at::Tensor> first_, second_;
  int step_ = 0;
};

template <class Work>
double Milliseconds(const Work& work) {
  const std::clock_t start = std::clock();
  work();
  return 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

double DifferentBits(const std::vector<at::Tensor>& a, const std::vector<at::Tensor>& b) {
  int64_t different = 0, all = 0;
  for (size_t i = 0; i < a.size(); ++i) different += (a[i] != b[i]).sum().item<int64_t>(), all += a[i].numel();
  return static_cast<double>(different) / static_cast<double>(all);
}

void Run(const Case& c, int threads, int steps) {
  at::set_num_threads(threads);
  const std::vector<at::Tensor> ours = Weights(c), theirs = Copies(ours);
  Adam adam;
  for (const at::Tensor& t : ours) adam.Add("", t);
  torch::optim::Adam peer(theirs, torch::optim::AdamOptions(kLearningRate));
  Reference reference(ours);
  std::vector<double> our_ms, their_ms, ratios;
  const at::NoGradGuard no_gradients;
  const std::vector<at::Tensor> gradients = RandomGradients(ours);
  for (int k = 0; k < steps; ++k) {
    SetGradients(gradients, k, ours, theirs);
    const auto step_ours = [&] { our_ms.push_back(Milliseconds([&] { adam.Step(kLearningRate); })); };
    if (k % 2 == 0) step_ours();
    their_ms.push_back(Milliseconds([&] { peer.step(); }));
    if (k % 2 == 1) step_ours();
    ratios.push_back(our_ms.back() / their_ms.back());
    reference.Step(ours);
  }
  int64_t count = 0;
  for (const at::Tensor& t : ours) count += t.numel();
  std::printf("%-26s %9lld %2d %8.3f %8.3f %6.2f   %.1e  %.1e  %5.1f %%\n", c.name, static_cast<long long>(count), threads,
              LinearQuantile(our_ms, 0.5), LinearQuantile(their_ms, 0.5), LinearQuantile(ratios, 0.5), reference.Distance(ours),
              reference.Distance(theirs), 100 * DifferentBits(ours, theirs));
}

}  // namespace
}  // namespace mvstudio::avatar

int main(int argc, char** argv) {
  // As mvstudio's own main does.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  const int steps = argc > 1 ? std::atoi(argv[1]) : 20;
  std::vector<mvstudio::avatar::Case> cases = mvstudio::avatar::Cases();
  if (argc > 2) cases.resize(std::min(cases.size(), static_cast<size_t>(std::atoi(argv[2]))));
  std::printf("medians of %d steps; distances from double precision after the last, in learning rates\n", steps);
  std::printf("%-26s %9s %2s %8s %8s %6s   %-7s  %-7s  %s\n", "", "values", "th", "own, ms", "torch", "ratio", "own", "torch",
              "other bits");
  for (const auto& each : cases) {
    for (const int threads : {1, 2}) mvstudio::avatar::Run(each, threads, steps);
  }
  return 0;
}
