#include "stages/nets/trials/trials.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/error.h"
#include "core/format.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::stages {

namespace {

AvatarTrial Blank(const std::string& method, const std::vector<std::string>& cameras) {
  AvatarTrial trial;
  trial.method = method, trial.cameras = cameras;
  std::sort(trial.cameras.begin(), trial.cameras.end());
  for (double* result : {&trial.ssim, &trial.psnr_db, &trial.mask_iou, &trial.fd, &trial.kid, &trial.train_s, &trial.s_per_step,
                         &trial.ms_per_frame, &trial.parameters, &trial.peak_rss_mb})
    *result = std::nan("");
  return trial;
}

/// The trials of one method with these cameras.
void AddTrials(const AvatarGrid& grid, const AvatarTrial& blank, std::vector<AvatarTrial>* trials) {
  const bool gaussians = blank.method == "gaussians";
  const std::vector<int>& numbers = gaussians ? grid.gaussians : grid.widths;
  for (const int size : grid.sizes) {
    for (const int number : numbers) {
      for (const int steps : grid.steps) {
        for (const std::string& loss : grid.losses) {
          const bool same = loss != grid.losses.front() || (!gaussians && number != numbers.front());
          if (steps == 0 && same) continue;  // they change nothing
          AvatarTrial trial = blank;
          trial.size_px = size, trial.steps = steps, trial.loss = loss;
          (gaussians ? trial.gaussians : trial.width) = number;
          trials->push_back(trial);
        }
      }
    }
  }
}

/// In arbitrary units, for the order.
double CostOf(const AvatarTrial& t) {
  constexpr int kWidthOfGaussians = 8;  // a step takes about as long
  return double{1} * t.steps * (t.method == "gaussians" ? kWidthOfGaussians : t.width) * t.size_px * t.size_px;
}

}  // namespace

std::string AvatarTrial::Name() const {
  const std::string size = std::to_string(size_px) + " px";
  if (method == "gaussians") {
    const std::string name = (gaussians > 0 ? std::to_string(gaussians) + " " : "") + "Gaussians, " + size;
    return steps == 0 ? name + ", not trained" : name + ", " + std::to_string(steps) + " steps, " + loss;
  }
  const std::string name = method == "tna" ? "" : method + ", ";
  if (steps == 0) return name + size + ", template without a network";
  return name + "width " + std::to_string(width) + ", " + size + ", " + std::to_string(steps) + " steps, " + loss;
}

std::vector<AvatarTrial> MakeTrials(const AvatarGrid& grid, const std::vector<std::string>& cameras) {
  std::set<size_t> counts;
  for (const int count : grid.cameras) {
    if (count < 1) throw UsageError("option 'cameras': at least 1");
    counts.insert(std::min(static_cast<size_t>(count), cameras.size()));
  }
  std::vector<AvatarTrial> trials;
  for (const size_t count : counts) {
    for (const std::string& method : grid.methods) {
      if (method != "tna" && method != "direct" && method != "v2v" && method != "gaussians")
        throw UsageError("option 'methods': '" + method + "' is none of tna, direct, v2v, gaussians");
      AddTrials(grid, Blank(method, {cameras.begin(), cameras.begin() + static_cast<int64_t>(count)}), &trials);
    }
  }
  std::stable_sort(trials.begin(), trials.end(),
                   [](const AvatarTrial& a, const AvatarTrial& b) { return CostOf(a) < CostOf(b); });
  return trials;
}

void MarkFronts(std::vector<AvatarTrial>* trials) {
  std::map<size_t, std::vector<AvatarTrial*>> by_cameras;
  for (AvatarTrial& trial : *trials) by_cameras[trial.cameras.size()].push_back(&trial);
  for (const auto& [count, group] : by_cameras) {
    std::vector<TradeoffPoint> train, render;
    for (const AvatarTrial* t : group) {
      train.push_back({t->Name(), t->train_s, 1 - t->ssim});
      render.push_back({t->Name(), t->ms_per_frame, 1 - t->ssim});
    }
    const std::vector<bool> train_front = ParetoFront(train), render_front = ParetoFront(render);
    for (size_t i = 0; i < group.size(); ++i) group[i]->train_front = train_front[i], group[i]->render_front = render_front[i];
  }
}

std::string TrialsText(const std::vector<AvatarTrial>& trials, const std::string& distance) {
  std::string text = Format(
      "method     cameras   px   size  steps  loss                SSIM  %12s      KID  training s  s/step  ms/frame  "
      "parameters  "
      "memory MB\n",
      distance.c_str());
  for (const AvatarTrial& t : trials) {
    text += Format("%-9s  %7zu  %3d  %5d  %5d  %-16s  %6s  %12s  %7s  %10s  %6s  %8s  %10s  %9s %s%s\n", t.method.c_str(),
                   t.cameras.size(), t.size_px, t.method == "gaussians" ? t.gaussians : t.width, t.steps, t.loss.c_str(),
                   Shown(t.ssim, 4).c_str(), Shown(t.fd, 3).c_str(), Shown(t.kid, 4).c_str(), Shown(t.train_s, 1).c_str(),
                   Shown(t.s_per_step, 3).c_str(), Shown(t.ms_per_frame, 2).c_str(), Shown(t.parameters, 0).c_str(),
                   Shown(t.peak_rss_mb, 0).c_str(), t.train_front ? "*" : "", t.render_front ? "+" : "");
  }
  text += "Size: channels of the first layer, or Gaussians to begin with (0: four on each pixel of the body).\n";
  return text + "Among trials with as many cameras no other is both better and faster to train (*), to render (+).\n";
}

}  // namespace mvstudio::stages
