#include "app/study/avatar_trials.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "app/study/tradeoff.h"
#include "core/error.h"
#include "core/format.h"

namespace mvstudio::app {

using nlohmann::ordered_json;

std::string AvatarTrial::Name() const {
  if (steps == 0) return std::to_string(size_px) + " px, template without a network";
  return "width " + std::to_string(width) + ", " + std::to_string(size_px) + " px, " + std::to_string(steps) + " steps, " +
         loss;
}

std::vector<AvatarTrial> MakeTrials(const AvatarGrid& grid, const std::vector<std::string>& cameras) {
  std::set<size_t> counts;
  for (const int count : grid.cameras) {
    if (count < 1) throw UsageError("option 'cameras': at least 1");
    counts.insert(std::min(static_cast<size_t>(count), cameras.size()));
  }
  std::vector<AvatarTrial> trials;
  for (const size_t count : counts) {
    for (const int size : grid.sizes) {
      for (const int width : grid.widths) {
        for (const int steps : grid.steps) {
          for (const std::string& loss : grid.losses) {
            if (steps == 0 && (width != grid.widths.front() || loss != grid.losses.front())) continue;  // they change nothing
            AvatarTrial trial;
            trial.width = width, trial.size_px = size, trial.steps = steps, trial.loss = loss;
            trial.cameras.assign(cameras.begin(), cameras.begin() + static_cast<int64_t>(count));
            std::sort(trial.cameras.begin(), trial.cameras.end());
            trial.ssim = trial.psnr_db = trial.mask_iou = trial.fd = trial.train_s = trial.s_per_step = trial.ms_per_frame =
                trial.parameters = trial.peak_rss_mb = std::nan("");
            trials.push_back(trial);
          }
        }
      }
    }
  }
  const auto cost = [](const AvatarTrial& t) { return double{1} * t.steps * t.width * t.size_px * t.size_px; };
  std::stable_sort(trials.begin(), trials.end(), [&](const AvatarTrial& a, const AvatarTrial& b) { return cost(a) < cost(b); });
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

ordered_json TrialsJson(const std::vector<AvatarTrial>& trials) {
  ordered_json table = ordered_json::array();
  for (const AvatarTrial& t : trials) {
    table.push_back({{"cameras", t.cameras.size()},
                     {"size_px", t.size_px},
                     {"width", t.width},
                     {"steps", t.steps},
                     {"loss", t.loss},
                     {"done", t.done},
                     {"ssim", FiniteOrNull(t.ssim)},
                     {"psnr_db", FiniteOrNull(t.psnr_db)},
                     {"mask_iou", FiniteOrNull(t.mask_iou)},
                     {"fd", FiniteOrNull(t.fd)},
                     {"train_s", FiniteOrNull(t.train_s)},
                     {"s_per_step", FiniteOrNull(t.s_per_step)},
                     {"ms_per_frame", FiniteOrNull(t.ms_per_frame)},
                     {"num_parameters", FiniteOrNull(t.parameters)},
                     {"peak_rss_mb", FiniteOrNull(t.peak_rss_mb)},
                     {"train_cameras", t.cameras},
                     {"on_front", t.train_front},
                     {"on_render_front", t.render_front}});
  }
  return table;
}

std::string TrialsText(const std::vector<AvatarTrial>& trials, const std::string& distance) {
  std::string text =
      Format("cameras   px  width  steps  loss                SSIM  %12s  training s  s/step  ms/frame  parameters\n",
             distance.c_str());
  for (const AvatarTrial& t : trials) {
    text += Format("%7zu  %3d  %5d  %5d  %-16s  %6s  %12s  %10s  %6s  %8s  %10s %s%s\n", t.cameras.size(), t.size_px, t.width,
                   t.steps, t.loss.c_str(), Shown(t.ssim, 4).c_str(), Shown(t.fd, 3).c_str(), Shown(t.train_s, 1).c_str(),
                   Shown(t.s_per_step, 3).c_str(), Shown(t.ms_per_frame, 2).c_str(), Shown(t.parameters, 0).c_str(),
                   t.train_front ? "*" : "", t.render_front ? "+" : "");
  }
  return text + "Among trials with as many cameras no other is both better and faster to train (*), to render (+).\n";
}

}  // namespace mvstudio::app
