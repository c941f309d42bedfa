#include "stages/nets/avatar_run.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "avatar/maps/camera_tensor.h"
#include "avatar/run/evaluate/evaluation_protocol.h"
#include "avatar/run/evaluate/strips.h"
#include "avatar/run/pack/pack_rows.h"
#include "avatar/splats/files/player_file.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/body_motion.h"
#include "stages/nets/pretrain_input.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
std::string HistoryHeader() {
  std::string header = "step,phase";
  for (const char* column : avatar::kLossColumns) header += std::string(",") + column;
  return header + ",wall_s";
}

/// Rows: truth, rendering, parts, texture coordinates; one column for each of up to six images.
at::Tensor SampleSheet(avatar::AvatarModel& model, const avatar::AvatarPack& pack) {
  std::vector<int64_t> rows;
  const int64_t count = std::min<int64_t>(pack.size(), 6);
  for (int64_t i = 0; i < count; ++i) rows.push_back((2 * i + 1) * pack.size() / (2 * count));
  const avatar::AvatarPack some = avatar::Select(pack, rows);
  const avatar::Rendering r = avatar::Render(model, PosesOf(some), some.size_px, some.size_px);
  const at::Tensor truth = some.images.to(at::kFloat) / 255 * (some.masks > 0).unsqueeze(1);
  const at::Tensor hue = r.part.to(at::kFloat).unsqueeze(1);
  const at::Tensor parts = at::cat({(hue * 7).remainder(25), (hue * 11).remainder(25), (hue * 17).remainder(25)}, 1) / 24;
  const at::Tensor uv = at::cat({r.uv, r.mask_prob.unsqueeze(1)}, 1);
  const at::Tensor columns = at::cat({truth, r.image, parts, uv}, 2);  // (n, 3, 4 H, W)
  return (at::cat(columns.unbind(0), 2) * 255).round().clamp(0, 255).to(at::kByte);
}

}  // namespace

std::vector<std::string> AvatarRun::Names() {
  return {avatar::kCheckpointFile,
          avatar::kRunConfigFile,
          body::kPersonFileName,
          kBodyMotionFile,
          kBodyTextureFile,
          avatar::kReferencesFile,
          avatar::kGaussiansFile,
          "gaussians.ply",
          splats::kPlayerFileName,
          "history.csv",
          "textures.png",
          "samples",
          "pictures",
          "avatar_eval.result.json",
          avatar::kProtocolFile,
          "eval",
          kPretrainFile};
}

void AvatarRun::RequireFree(bool overwrite) const {
  if ((fs::exists(checkpoint_path()) || avatar::HoldsGaussians(folder_)) && !overwrite) {
    throw ResultExistsError(
        folder_,
        "option 'out' " + folder_ +
            " holds a trained avatar: choose another folder, continue it with `avatar resume`, or give option 'overwrite'");
  }
}

void AvatarRun::Clear() const {
  std::vector<std::string> paths;
  for (const std::string& name : Names()) paths.push_back(Path(name));
  RemoveOurs(paths);
  MakeFolder(folder_);
}

void AvatarRun::ForgetScores() const {
  RemoveOurs({Path("avatar_eval.result.json"), Path(avatar::kProtocolFile), Path("eval")});
}

double AvatarRun::ContinueHistory(int64_t step) {
  if (!fs::exists(Path("history.csv"))) return 0;
  std::istringstream lines(ReadFile(Path("history.csv")));
  std::string line;
  std::getline(lines, line);
  if (line != HistoryHeader()) throw FormatError(Path("history.csv"), "line 1", "is not the header of a training history");
  double wall_s = 0;
  while (std::getline(lines, line)) {
    std::istringstream in(line);
    int64_t row_step = 0;
    if (!(in >> row_step) || row_step > step) break;
    std::istringstream(line.substr(line.rfind(',') + 1)) >> wall_s;
    rows_.push_back(line);
  }
  return wall_s;
}

void AvatarRun::AddRow(const avatar::HistoryRow& row, double wall_s) {
  std::string text = std::to_string(row.step) + "," + row.phase;
  for (const double value : row.values) {
    text += Format(",%.6g", value);
  }
  // A check of the same step comes first, so that it is there when the step is saved, but stands behind it.
  const bool after_check = !rows_.empty() && rows_.back().rfind(std::to_string(row.step) + ",validation", 0) == 0;
  rows_.insert(rows_.end() - (after_check ? 1 : 0), text + Format(",%.2f", wall_s));
}

void AvatarRun::Save(avatar::Trainer& trainer, const avatar::AvatarPack& sample_pack) const {
  FilesTogether together;
  std::string history = HistoryHeader() + "\n";
  for (const std::string& row : rows_) history += row + "\n";
  WriteFileAtomic(Path("history.csv"), history);
  trainer.UseHanded([&](avatar::AvatarModel& model) {
    if (model.textures.defined()) dataset::WriteImage(avatar::ImageOfBytes(avatar::TextureSheet(model)), Path("textures.png"));
    dataset::WriteImage(avatar::ImageOfBytes(SampleSheet(model, sample_pack)), StepPath("samples", model.step));
  });
  // Last: a run goes on from its checkpoint, and rows of later steps are then left out.
  avatar::WriteTensorFile(trainer.Checkpoint(), checkpoint_path());
  together.Commit();
}

std::string AvatarRun::StepPath(const std::string& folder, int64_t step) const {
  return Path(folder + Format("/step_%06lld.png", static_cast<long long>(step)));
}

void AvatarRun::SaveImage(avatar::Trainer& trainer, const avatar::AvatarPack& pack) const {
  const avatar::AvatarPack one = avatar::Select(pack, {pack.size() / 2});
  const at::Tensor truth = one.images[0].to(at::kFloat) / 255 * (one.masks[0] > 0);
  trainer.UseHanded([&](avatar::AvatarModel& model) {
    const avatar::Rendering r = avatar::Render(model, PosesOf(one), one.size_px, one.size_px);
    if (avatar::NumBoneChannels(model.options) == 0) {
      const at::Tensor input =
          (one.references.defined() ? one.references[0].slice(0, 0, 3) : one.template_colours[0]).to(at::kFloat) / 255;
      dataset::WriteImage(avatar::MakeStrip(truth, r.image[0], input), StepPath("pictures", model.step));
      return;
    }
    const at::Tensor joints_px = avatar::ProjectPinhole(one.intrinsics, one.joints_in_cam);
    const at::Tensor maps = avatar::NetworkInput(model, one.joints_in_cam, one.joint_valid, joints_px, one.size_px, one.size_px,
                                                 PosesOf(one).body)[0]
                                .slice(0, 0, model.options.inputs);
    const bool slopes = maps.size(0) == 2 * avatar::kNumBones;
    const at::Tensor bones = maps.slice(0, 0, slopes ? avatar::kNumBones : maps.size(0));
    // The nearest bone of a pixel: near ones red, far ones blue.
    const at::Tensor drawn = (bones > -1).any(0), depth = (bones.masked_fill(bones <= -1, 2).amin(0).clamp(-1, 1) + 1) / 2;
    const at::Tensor input = at::stack({1 - depth, at::full_like(depth, 0.3), depth}) * drawn;
    dataset::WriteImage(avatar::MakeStrip(truth, r.image[0], input), StepPath("pictures", model.step));
  });
}

std::vector<CommandResult::Output> AvatarRun::Outputs() const {
  std::vector<CommandResult::Output> outputs;
  if (fs::exists(checkpoint_path())) outputs.push_back({checkpoint_path(), "checkpoint"});
  if (avatar::HoldsGaussians(folder_)) {
    outputs.push_back({Path(avatar::kGaussiansFile), "checkpoint"});
    outputs.push_back({Path("gaussians.ply"), "gaussians"});
    if (fs::exists(Path(splats::kPlayerFileName))) outputs.push_back({Path(splats::kPlayerFileName), "gaussians-player"});
  }
  if (fs::exists(Path(avatar::kReferencesFile))) outputs.push_back({Path(avatar::kReferencesFile), "references"});
  if (fs::exists(Path(kBodyMotionFile))) outputs.push_back({Path(kBodyMotionFile), "body-motion"});
  if (fs::exists(Path(kBodyTextureFile))) outputs.push_back({Path(kBodyTextureFile), "body-texture"});
  outputs.push_back({Path(avatar::kRunConfigFile), "configuration"});
  outputs.push_back({Path("history.csv"), "history"});
  if (fs::exists(Path("textures.png"))) outputs.push_back({Path("textures.png"), "textures"});
  for (const char* folder : {"samples", "pictures"}) {
    const std::vector<std::string> samples = FilesNamed(Path(folder), "step_", ".png");
    if (!samples.empty()) outputs.push_back({samples.back(), "sample-picture"});
  }
  return outputs;
}

}  // namespace mvstudio::stages
