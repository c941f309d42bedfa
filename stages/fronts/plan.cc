#include "stages/fronts/plan.h"

#include <algorithm>

namespace mvstudio::stages {
namespace {

using Options = std::vector<LineOption>;
using Json = nlohmann::ordered_json;

constexpr char kRunFirst[] = "not there yet: `mvstudio run SESSION` makes it";

double NumberIn(const Json& json, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  return json.contains(at) && json[at].is_number() ? json[at].get<double>() : NAN;
}

/// The error is a figure of the last command's metrics; of several pointers the first that is there.
ReadFigures ErrorAt(std::vector<std::string> pointers, bool of_one = false) {
  return [pointers = std::move(pointers), of_one](const CommandResult& work, const CommandResult& judge, FrontWay* way) {
    const Json& metrics = judge.metrics.empty() ? work.metrics : judge.metrics;
    for (const std::string& pointer : pointers) {
      const double value = NumberIn(metrics, pointer);
      if (std::isfinite(value) && !std::isfinite(way->error)) way->error = of_one ? 1 - value : value;
    }
  };
}

class Planner {
 public:
  explicit Planner(const FrontsMaterial& material) : m_(material) {}

  PlannedFront Calibrate() {
    Begin("calibrate", "rig on held-out boards, RMS (px)");
    const auto way = [&](const std::string& name, WayMark mark, const Options& options) {
      Options all = {{"session", {m_.session}}, {"holdout", {"every:4"}}, {"cache", {"off"}}};
      Add(name, mark, {"calibrate"}, Joined(std::move(all), options), ErrorAt({"/rig_holdout_rms_px"}));
    };
    way("default", WayMark::kDefault, {});
    way("detector exact", WayMark::kPreset, {{"detector", {"exact"}}});
    for (const char* model : {"brown1", "brown2", "brown5", "rational8"}) way(model, WayMark::kNone, {{"model", {model}}});
    way("mrcal, brown5", WayMark::kPeer, {{"engine", {"mrcal"}}, {"model", {"brown5"}}});
    return std::move(planned_);
  }

  PlannedFront Pose2d() {
    Begin("pose2d", "camera that is left out, median (px)");
    Need(m_.calibration, "a calibration is");
    const auto way = [&](const std::string& name, WayMark mark, const Options& options) {
      Options all = {{"calib", {m_.calibration}}, {"overlays", {"0"}}, {"cache", {"off"}}};
      if (!m_.whole_take) all.push_back({"frames", {m_.quick ? "0-7" : "0-19"}});
      Add(name, mark, {"pose2d"}, Joined(Joined(OfTake(), all), options), ErrorAt({"/agreement/median_px"}));
    };
    way("default", WayMark::kDefault, {});
    for (const char* backend : {"posenet", "movenet", "blazepose"}) {
      for (const char* quality : {"fast", "balanced", "exact"}) {
        if (m_.quick && std::string(quality) == "exact") continue;
        way(std::string(backend) + " " + quality, WayMark::kPreset, {{"backend", {backend}}, {"quality", {quality}}});
      }
    }
    return std::move(planned_);
  }

  PlannedFront Mask() {
    const bool truth = !m_.truth_masks.empty();
    Begin("mask", truth ? "1 - IoU with the true masks" : "disagreement with the visual hull (part of the masks)");
    Need(m_.pose3d, "3D joints are");
    const auto way = [&](const std::string& name, WayMark mark, const Options& options) {
      Options all = {{"sheet-tiles", {"0"}}, {"cache", {"off"}}};
      if (!m_.whole_take) all.push_back({"frames", {m_.quick ? "0-5" : "0-11"}});
      if (truth) all.push_back({"truth", {}});
      for (const std::string& camera : m_.cameras)
        if (truth) all.back().values.push_back(camera + "=" + m_.truth_masks + "/" + camera);
      Add(name, mark, {"mask"}, Joined(Joined(OfTake(), all), options),
          truth ? ErrorAt({"/truth/mean_iou"}, true) : ErrorAt({"/disagreement_with_hull"}));
    };
    way("default", WayMark::kDefault, {});
    way("background", WayMark::kPreset, {{"backend", {"background"}}});
    way("selfie", WayMark::kPreset, {{"backend", {"selfie"}}});
    way("background, coarse", WayMark::kNone,
        {{"backend", {"background"}}, {"mask-coarse-side", {"160"}}, {"mask-outline", {"0"}}});
    way("background, hull", WayMark::kNone, {{"backend", {"background"}}, {"hull", {}}});
    return std::move(planned_);
  }

  PlannedFront Triangulate() {
    Begin("triangulate", "camera that is left out, median (px)");
    Need(m_.calibration, "a calibration is");
    const auto way = [&](const std::string& name, WayMark mark, const Options& options) {
      Add(name, mark, {"triangulate"}, Joined(OfTake(), options),
          ErrorAt({"/refinement/holdout_median_px/after", "/holdout/median_px"}));
    };
    way("default", WayMark::kDefault, {});
    way("refine", WayMark::kPreset, {{"refine", {}}});
    for (const char* method : {"robust", "all-views", "linear", "midpoint"})
      way(method, WayMark::kPreset, {{"method", {method}}});
    way("dlt (as OpenCV)", WayMark::kPeer, {{"method", {"dlt"}}});
    way("exhaustive-dlt (as Pose2Sim)", WayMark::kPeer, {{"method", {"exhaustive-dlt"}}});
    return std::move(planned_);
  }

  PlannedFront Pack() {
    Begin("pack", "crops against the image, RMS (levels of 255)");
    planned_.front.cost = "1,000 crops of 128 px at random, by the clock (s)";
    planned_.front.space = "a stored crop (KiB)";
    Need(m_.dataset, "a dataset is");
    for (const char* codec : {"raw", "png", "jpeg:98", "jpeg:95", "jpeg:90"}) {
      const bool is_default = std::string(codec) == "png";
      PackWay(codec, is_default ? WayMark::kDefault : WayMark::kPreset, codec, "pack", codec);
    }
    PackWay("images, cropped when read", WayMark::kPeer, "raw", "folder", "as it is");
    return std::move(planned_);
  }

  PlannedFront Avatar() {
    Begin("avatar", "1 - SSIM of a camera that is held out");
    Need(m_.dataset, "a dataset is");
    const std::string steps = m_.quick ? "60" : "300";
    AvatarWay("default", WayMark::kDefault, {});
    AvatarWay("Gaussians, " + steps + " steps", WayMark::kPreset, {{"method", {"gaussians"}}, {"steps", {steps}}});
    AvatarWay("tna on the template, " + steps + " steps", WayMark::kPreset,
              {{"prior", {"template"}}, {"width", {"8"}}, {"steps", {steps}}});
    AvatarWay("direct from bones, " + steps + " steps", WayMark::kPreset,
              {{"method", {"direct"}}, {"prior", {"none"}}, {"width", {"8"}}, {"steps", {steps}}});
    return std::move(planned_);
  }

 private:
  void Begin(const std::string& stage, const std::string& error) {
    planned_ = {};
    planned_.front.stage = stage, planned_.front.error = error;
    planned_.front.cost = "processor time (s)", planned_.front.space = "peak memory (MiB)";
  }

  void Need(const std::string& path, const std::string& what) {
    if (path.empty() && planned_.front.why_not.empty()) planned_.front.why_not = what + " " + kRunFirst;
  }

  static Options Joined(Options first, const Options& more) {
    first.insert(first.end(), more.begin(), more.end());
    return first;
  }

  Options OfTake() const { return {{"session", {m_.session}}, {"take", {m_.take}}}; }

  /// A folder for each way: "RUNS/mask-2".
  std::string Folder() const { return m_.runs + "/" + planned_.front.stage + "-" + std::to_string(planned_.ways.size() + 1); }

  Options Common() const { return {{"threads", {std::to_string(m_.threads)}}, {"seed", {std::to_string(m_.seed)}}}; }

  void Add(const std::string& name, WayMark mark, std::vector<std::string> command, const Options& options,
           const ReadFigures& read) {
    const CommandLine line{std::move(command), Joined(Joined(options, {{"out", {Folder()}}}), Common())};
    planned_.ways.push_back({name, mark, line, {}, read});
  }

  /// Seconds are those of reading: the command makes the pack, too. `way` and `codec` are the row's that is read.
  void PackWay(const std::string& name, WayMark mark, const std::string& packed, const std::string& way,
               const std::string& codec) {
    const Options options = {{"codecs", {packed}},
                             {"crops", {"128"}},
                             {"threads-list", {"1"}},
                             {"frames", {m_.quick ? "4" : "16"}},
                             {"seconds", {m_.quick ? "0.3" : "1"}}};
    Add(name, mark, {"tradeoff", "pack", m_.dataset}, options,
        [way, codec](const CommandResult& work, const CommandResult&, FrontWay* figures) {
          if (!work.metrics.contains("trials")) return;
          for (const Json& trial : work.metrics["trials"]) {
            if (trial.value("way", "") != way || trial.value("codec", "") != codec) continue;
            figures->seconds = 1000 / NumberIn(trial, "/crops_per_s"), figures->cpu_s = NAN;
            figures->stored_kib = NumberIn(trial, "/bytes_per_crop") / 1024;
            figures->error = trial.value("exact", false) ? 0 : 255 * std::pow(10, -NumberIn(trial, "/psnr_db") / 20);
          }
        });
  }

  void AvatarWay(const std::string& name, WayMark mark, const Options& options) {
    const Options all = {{"size", {m_.quick ? "64" : "96"}}, {"holdout-cameras", {m_.held_out}}};
    const std::string run = Folder();
    Add(name, mark, {"avatar", "train", m_.dataset}, Joined(all, options), ErrorAt({"/holdout/ssim"}, true));
    planned_.ways.back().judge = {{"avatar", "eval", run}, Joined({{"other-pictures", {"0"}}, {"renders", {"0"}}}, Common())};
  }

  const FrontsMaterial& m_;
  PlannedFront planned_;
};

}  // namespace

std::vector<PlannedFront> PlanFronts(const FrontsMaterial& material, const std::vector<std::string>& only) {
  Planner planner(material);
  std::vector<PlannedFront> planned = {planner.Calibrate(),   planner.Pose2d(), planner.Mask(),
                                       planner.Triangulate(), planner.Pack(),   planner.Avatar()};
  const auto not_asked = [&](const PlannedFront& p) {
    return !only.empty() && std::find(only.begin(), only.end(), p.front.stage) == only.end();
  };
  planned.erase(std::remove_if(planned.begin(), planned.end(), not_asked), planned.end());
  return planned;
}

}  // namespace mvstudio::stages
