// One image learnt by heart: beyond 40 dB, which no blur, seam or shift of a pixel allows.
#include <ATen/ATen.h>

#include <cmath>
#include <cstdio>
#include <utility>

#include "avatar/train/train.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

struct Quality {
  double whole_db, person_db;
};

Quality Compare(const at::Tensor& image, const AvatarPack& pack) {
  const at::Tensor error = (image.to(at::kDouble) - pack.images.to(at::kDouble) / 255).square(),
                   person = (pack.masks > 0).unsqueeze(1).to(at::kDouble);
  const double whole = error.mean().item<double>(), inside = ((error * person).sum() / (3 * person.sum())).item<double>();
  return {-10 * std::log10(whole), -10 * std::log10(inside)};
}

Quality Overfit(const char* method, int steps) {
  const AvatarPack pack = MakeSyntheticPack(1, 64, 5, 0.05);
  ModelOptions model;
  FromString(method, &model.method);
  model.width = 8, model.downs = 3, model.encoder_blocks = 1, model.decoder_blocks = 1, model.texture_px = 64;
  TrainOptions options;
  options.init_steps = 150, options.steps = steps, options.batch = 1, options.learning_rate = 3e-3;
  options.keep_init = 0, options.weight_logit = 0, options.weight_ssim = 0.2;
  options.jitter_scale = options.jitter_shift = options.jitter_roll_deg = 0;
  options.report_every = 100, options.validate_images = 0;
  RunContext run;
  run.num_threads = 1, run.seed = 3;
  AvatarModel trained;
  const TrainReport report = TrainTna(pack, nullptr, model, options, run, nullptr, &trained);
  EXPECT_EQ(report.status, Status::kOk) << report.message;
  const Rendering r = Render(trained, PosesOf(pack), pack.size_px, pack.size_px);
  return Compare(r.image, pack);
}

TEST(Overfit, OneImageBeyond40Db) {
  for (const auto& [method, steps] : {std::pair<const char*, int>{"direct", 2200}, {"tna", 600}}) {
    const Quality quality = Overfit(method, steps);
    EXPECT_GT(quality.whole_db, 40) << method;
    EXPECT_GT(quality.person_db, 40) << method;
    std::printf("%s: %.1f dB, on the person %.1f dB\n", method, quality.whole_db, quality.person_db);
  }
}

}  // namespace
}  // namespace mvstudio::avatar
