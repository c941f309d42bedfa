#include "avatar/train/batch.h"

#include <ATen/ATen.h>

#include <cmath>
#include <numeric>

#include "avatar/maps/camera_tensor.h"
#include "avatar/maps/spread_labels.h"
#include "avatar/maps/template_maps.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/units.h"

namespace mvstudio::avatar {
namespace {

/// p' = scale * turn * (p - centre) + centre + shift, for pixels.
struct Jitter {
  double scale = 1, cosine = 1, sine = 0, shift_x_px = 0, shift_y_px = 0;
};

Jitter DrawJitter(const TrainOptions& options, int size_px, Rng& random) {
  Jitter j;
  j.scale = random.Uniform(1 - options.jitter_scale, 1 + options.jitter_scale);
  const double angle = DegToRad(random.Uniform(-options.jitter_roll_deg, options.jitter_roll_deg));
  j.cosine = std::cos(angle), j.sine = std::sin(angle);
  j.shift_x_px = random.Uniform(-1, 1) * options.jitter_shift * size_px;
  j.shift_y_px = random.Uniform(-1, 1) * options.jitter_shift * size_px;
  return j;
}

/// Rows that take target to source coordinates in [-1, 1], for at::affine_grid_generator.
void FillTheta(const Jitter& j, int size_px, float* theta) {
  const double a = j.cosine / j.scale, b = j.sine / j.scale;
  const double tx = 2 * j.shift_x_px / size_px, ty = 2 * j.shift_y_px / size_px;
  const double rows[6] = {a, b, -(a * tx + b * ty), -b, a, -(-b * tx + a * ty)};
  for (int i = 0; i < 6; ++i) theta[i] = static_cast<float>(rows[i]);
}

void MoveJoints(const Jitter& j, int size_px, int64_t num_joints, float* joints) {
  const double centre = 0.5 * (size_px - 1);
  for (int64_t k = 0; k < num_joints; ++k) {
    const double x = joints[2 * k] - centre, y = joints[2 * k + 1] - centre;
    joints[2 * k] = static_cast<float>(j.scale * (j.cosine * x - j.sine * y) + centre + j.shift_x_px);
    joints[2 * k + 1] = static_cast<float>(j.scale * (j.sine * x + j.cosine * y) + centre + j.shift_y_px);
  }
}

/// The body in moved images: cover, colours and references are smooth quantities, parts and coordinates are labels.
void MoveBody(const at::Tensor& grid, TemplateView* body) {
  if (body->maps.defined())
    body->maps = at::cat({at::grid_sampler_2d(body->maps.slice(1, 0, 1), grid, 0, 0, false).clamp(0, 1),
                          at::grid_sampler_2d(body->maps.slice(1, 1, kTemplateMaps), grid, 1, 0, false)},
                         1);
  if (body->references.defined()) body->references = at::grid_sampler_2d(body->references, grid, 0, 0, false);
  if (body->colours.defined()) body->colours = at::grid_sampler_2d(body->colours, grid, 0, /*border*/ 1, false);
}

/// Applies one random motion each to the batch, its keypoints and its body.
void ApplyJitter(const TrainOptions& options, int size_px, uint64_t seed, int64_t step, int64_t first, TrainBatch& batch,
                 at::Tensor& joints_px, TemplateView* body) {
  const auto count = static_cast<int64_t>(batch.images.size());
  at::Tensor theta = at::zeros({count, 2, 3}, at::kFloat);
  Rng random(seed * 0x9e3779b97f4a7c15ull + static_cast<uint64_t>(step) * 2 + 1);
  for (int64_t i = 0; i < first; ++i) DrawJitter(options, size_px, random);
  joints_px = joints_px.contiguous();
  for (int64_t i = 0; i < count; ++i) {
    const Jitter j = DrawJitter(options, size_px, random);
    FillTheta(j, size_px, theta.data_ptr<float>() + 6 * i);
    MoveJoints(j, size_px, joints_px.size(1), joints_px.data_ptr<float>() + 2 * joints_px.size(1) * i);
  }
  const at::Tensor grid = at::affine_grid_generator(theta, {count, 1, size_px, size_px}, false);
  const at::Tensor smooth = at::grid_sampler_2d(at::cat({batch.image, batch.mask.unsqueeze(1)}, 1), grid, 0, 0, false);
  const at::Tensor labels =
      at::grid_sampler_2d(at::cat({batch.part.to(at::kFloat).unsqueeze(1), batch.uv}, 1), grid, 1, 0, false);
  batch.image = smooth.slice(1, 0, 3).contiguous();
  batch.mask = smooth.select(1, 3).contiguous();
  batch.part = labels.select(1, 0).round().to(at::kLong);
  batch.uv = labels.slice(1, 1, 3).contiguous();
  MoveBody(grid, body);
}

}  // namespace

std::vector<int64_t> ImagesOfStep(int64_t num_images, int64_t batch, uint64_t seed, int64_t step) {
  std::vector<int64_t> rows, order(num_images);
  int64_t shuffled_epoch = -1;
  for (int64_t k = step * batch; k < (step + 1) * batch; ++k) {
    if (const int64_t epoch = k / num_images; epoch != shuffled_epoch) {
      shuffled_epoch = epoch;
      std::iota(order.begin(), order.end(), 0);
      Rng random(seed * 0xd1342543de82ef95ull + static_cast<uint64_t>(epoch));
      for (int64_t i = num_images - 1; i > 0; --i) std::swap(order[i], order[random.Index(i + 1)]);
    }
    rows.push_back(order[k % num_images]);
  }
  return rows;
}

TrainBatch MakeBatch(const AvatarPack& pack, const AvatarModel& model, const TrainOptions& options,
                     const std::vector<int64_t>& images, bool jitter, uint64_t seed, int64_t step, int64_t first) {
  const at::Tensor rows = at::tensor(images, at::kLong);
  TrainBatch batch;
  batch.images = images;
  batch.mask = pack.masks.index_select(0, rows).to(at::kFloat) / 255;
  batch.image = pack.images.index_select(0, rows).to(at::kFloat) / 255 * batch.mask.unsqueeze(1);
  batch.part = pack.part.index_select(0, rows).to(at::kLong);
  batch.uv = pack.uv.index_select(0, rows);
  PoseBatch poses = PosesOf(pack, rows);
  at::Tensor joints_px = ProjectPinhole(poses.intrinsics, poses.joints_in_cam);
  if (jitter) ApplyJitter(options, pack.size_px, seed, step, first, batch, joints_px, &poses.body);
  batch.uv = batch.uv * 2 - 1;
  batch.maps = NetworkInput(model, poses.joints_in_cam, poses.joint_valid, joints_px, pack.size_px, pack.size_px, poses.body);
  const at::Device device = model.generator->parameters()[0].device();
  for (at::Tensor* t : {&batch.maps, &batch.image, &batch.mask, &batch.part, &batch.uv}) *t = t->to(device);
  return batch;
}

void FitLabelsToMasks(AvatarPack& pack, int num_threads) {
  pack.part = pack.part.clone(), pack.uv = pack.uv.clone();
  const at::Tensor masks = pack.masks.contiguous();
  const int64_t size = pack.size_px, area = size * size;
  const uint8_t* mask = masks.data_ptr<uint8_t>();
  uint8_t* part = pack.part.data_ptr<uint8_t>();
  float* uv = pack.uv.data_ptr<float>();
  ParallelFor(pack.size(), num_threads,
              [&](int64_t i) { SpreadLabels(size, mask + i * area, part + i * area, uv + 2 * i * area); });
}

}  // namespace mvstudio::avatar
