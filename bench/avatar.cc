#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <malloc.h>

#include <fstream>

#include "avatar/data/safetensors.h"
#include "avatar/nets/model.h"
#include "avatar/train/adam.h"
#include "avatar/train/loss_terms.h"
#include "bench/requests.h"
#include "core/random.h"

/// bench_avatar: the timed side of bench/avatar_speed.py. Its requests:
///   start METHOD WIDTH SIZE BATCH FILE   a fresh model and a made-up batch, both written to FILE (safetensors); answers
///                                        "PARAMETERS"
///   step                                 one training step on that batch; answers "LOSS SECONDS CPU_SECONDS"
///   render                               one image from its pose, bone maps included; answers "MEAN SECONDS CPU_SECONDS"
///   threads N                            answers "ok"
///   memory                               answers the peak of resident memory so far, MB
namespace mvstudio::avatar {
namespace {

struct Bench {
  AvatarModel model;
  TrainOptions options;
  StepInput input;
  at::Tensor joints, valid, intrinsics;  // of one pose
  Adam network, texels;
  int64_t size_px = 0;
};

/// A standing person as its joints, shaken a little: (batch, 19, 3) metres, in cam.
at::Tensor Poses(int64_t batch, Rng& rng) {
  const double rest[19][2] = {{0, -.5},   {0, -.65},  {0, 0},      {.2, -.5},   {.3, -.25},  {.35, 0}, {.1, 0},
                              {.12, .4},  {.13, .8},  {-.2, -.5},  {-.3, -.25}, {-.35, 0},   {-.1, 0}, {-.12, .4},
                              {-.13, .8}, {.03, -.7}, {.08, -.68}, {-.03, -.7}, {-.08, -.68}};
  at::Tensor joints = at::zeros({batch, 19, 3}, at::kFloat);
  float* p = joints.data_ptr<float>();
  for (int64_t i = 0; i < batch * 19; ++i) {
    for (int c = 0; c < 2; ++c) p[3 * i + c] = static_cast<float>(rest[i % 19][c] + rng.Uniform(-0.05, 0.05));
    p[3 * i + 2] = static_cast<float>(3 + rng.Uniform(-0.2, 0.2));
  }
  return joints;
}

at::Tensor Uniform(at::IntArrayRef sizes, double low, double high, Rng& rng) {
  at::Tensor x = at::empty(sizes, at::kFloat);
  for (int64_t i = 0; i < x.numel(); ++i) x.data_ptr<float>()[i] = static_cast<float>(rng.Uniform(low, high));
  return x;
}

at::Tensor Pixels(const at::Tensor& intrinsics, const at::Tensor& joints) {
  const at::Tensor ratio = joints.slice(2, 0, 2) / joints.slice(2, 2, 3);
  return ratio * intrinsics.slice(1, 0, 2).unsqueeze(1) + intrinsics.slice(1, 2, 4).unsqueeze(1);
}

/// A batch whose person is where its bones are and whose colours are noise: times do not depend on them.
void MakeInput(Bench* bench, int64_t batch, Rng& rng) {
  const int64_t size = bench->size_px;
  bench->joints = Poses(batch, rng);
  bench->valid = at::ones({batch, 19}, at::kBool);
  const double focal = 1.6 * static_cast<double>(size), centre = 0.5 * static_cast<double>(size - 1);
  bench->intrinsics = at::tensor({focal, focal, centre, centre}, at::kFloat).expand({batch, 4}).contiguous();
  const at::Tensor px = Pixels(bench->intrinsics, bench->joints);
  TrainBatch& b = bench->input.batch;
  b.maps = NetworkInput(bench->model, bench->joints, bench->valid, px, size, size);
  b.mask = (b.maps.slice(1, 0, 18).amax(1) > -1).to(at::kFloat);
  b.image = Uniform({batch, 3, size, size}, 0, 1, rng) * b.mask.unsqueeze(1);
  b.part = ((b.maps.slice(1, 0, 18).argmax(1) + 1) * b.mask).to(at::kLong);
  b.uv = Uniform({batch, 2, size, size}, -1, 1, rng);
}

void WriteAll(const Bench& bench, const std::string& path) {
  TensorFile file = ModelToTensors(bench.model);
  const TrainBatch& b = bench.input.batch;
  for (const auto& [name, tensor] : {std::pair<const char*, at::Tensor>{"maps", b.maps},
                                     {"image", b.image},
                                     {"mask", b.mask},
                                     {"part", b.part},
                                     {"uv", b.uv}})
    file.tensors["batch." + std::string(name)] = tensor.contiguous();
  for (const auto& [name, value] : FieldsAsText(bench.options)) file.metadata["train." + name] = value;
  WriteTensorFile(file, path);
}

void Start(Bench* bench, std::istringstream& words) {
  *bench = Bench();
  ModelOptions options;
  int64_t batch = 0;
  std::string method, path;
  words >> method >> options.width >> bench->size_px >> batch >> path;
  FromString(method, &options.method);
  Rng rng(1);
  bench->model = MakeModel(options, static_cast<int>(bench->size_px), {-0.5, 0.5}, 1);
  if (bench->model.textures.defined()) {
    const at::NoGradGuard no_gradients;
    bench->model.textures.copy_(Uniform(bench->model.textures.sizes(), -0.9, 0.9, rng));
    bench->texels.Add("textures", bench->model.textures);
  }
  bench->options.keep_init = KeepInit({}, options);
  MakeInput(bench, batch, rng);
  for (const auto& item : bench->model.generator->named_parameters()) bench->network.Add(item.key(), item.value());
  if (path != "-") WriteAll(*bench, path);
  std::printf("%lld\n", static_cast<long long>(NumParameters(options)));
}

/// What Trainer does in a step of the last phase: all loss terms, clipped gradients, Adam.
double Step(Bench* bench) {
  bench->model.generator->train();
  bench->network.ClearGradients(), bench->texels.ClearGradients();
  const LossTerms terms = ComputeLoss(bench->model, bench->options, bench->input, false, {});
  terms.total().backward();
  const at::NoGradGuard no_gradients;
  const double norm = bench->network.GradientNorm(), clip = bench->options.clip_norm;
  if (norm > clip) bench->network.ScaleGradients(clip / norm);
  bench->network.Step(bench->options.learning_rate);
  bench->texels.Step(bench->options.texture_learning_rate);
  return terms.total().item<double>();
}

double RenderOne(Bench* bench) {
  const auto first = [](const at::Tensor& t) { return t.slice(0, 0, 1); };
  const PoseBatch pose = {first(bench->joints), first(bench->valid), first(bench->intrinsics), {}};
  const Rendering r = Render(bench->model, pose, bench->size_px, bench->size_px);
  return r.image.mean().item<double>();
}

double PeakMemoryMb() {
  std::ifstream status("/proc/self/status");
  std::string word;
  double kb = 0;
  while (status >> word) {
    if (word == "VmHWM:") status >> kb;
  }
  return kb / 1024;
}

int Serve() {
  Bench b;
  return bench::Answer("bench_avatar",
                       {{"start", [&](std::istringstream& words) { Start(&b, words); }},
                        {"step", [&](std::istringstream&) { bench::PrintTimed([&] { return Step(&b); }); }},
                        {"render", [&](std::istringstream&) { bench::PrintTimed([&] { return RenderOne(&b); }); }},
                        {"threads",
                         [&](std::istringstream& words) {
                           at::set_num_threads(bench::Number(words));
                           std::printf("ok\n");
                         }},
                        {"memory", [&](std::istringstream&) { std::printf("%.0f\n", PeakMemoryMb()); }}});
}

}  // namespace
}  // namespace mvstudio::avatar

int main() {
  // As mvstudio's own main does.
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  return mvstudio::avatar::Serve();
}
