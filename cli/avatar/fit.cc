#include <memory>

#include "cli/avatar/body_folder.h"
#include "cli/avatar/split_options.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "stages/dataset/studio_names.h"
#include "stages/input/mask_notice.h"
#include "stages/nets/avatar_fit.h"
#include "stages/nets/avatar_train_data.h"

namespace mvstudio::cli {
namespace {

struct FitArguments {
  std::string dataset, out, body_template = "mannequin";
  stages::SplitArguments split;
  avatar::PersonFitOptions options;
  avatar::PoseBy pose_by = avatar::PoseBy::kImages;
  bool overwrite = false;
  double frame_rate_hz = 30;
};

CommandResult RunFit(const FitArguments& arguments, CommandContext& context) {
  context.camera_names = stages::StudioNames(arguments.dataset);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(arguments.dataset);
  const int person = avatar::ChoosePerson(data, arguments.options.person);
  const avatar::DatasetSplit split = stages::SplitOf(data, person, arguments.split);
  avatar::PersonFitOptions options = arguments.options;
  options.templates = stages::TemplatesOf(arguments.body_template);
  const OutputFolder place(arguments.out, {arguments.dataset}, BodyFolder::Names());
  const std::vector<Notice> notices = stages::CheckTrainingImages(data, split, context.run);
  const BodyFolder folder(arguments.out, arguments.overwrite);
  const avatar::PersonFit fit = stages::FitToSplit(data, split, person, arguments.pose_by, options, context.run);
  CommandResult result;
  result.folder = arguments.out, result.inputs = {arguments.dataset};
  stages::TellSplitFrames(data, arguments.split, &result);
  result.metrics = stages::ToJson(fit);
  folder.Write(fit.result, arguments.frame_rate_hz, &result);
  result.text = stages::ToTable(fit);
  stages::AddFitWarnings(fit, &result);
  result.warnings.insert(result.warnings.end(), notices.begin(), notices.end());
  stages::TellMasks(data.Masks(), arguments.dataset + "/masks", &result);
  return result;
}

}  // namespace

void RegisterAvatarFit(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<FitArguments>();
  CLI::App* sub = avatar.add_subcommand("fit", "Fit a body to a person's joints and silhouettes, and average its colours");
  AddOption(sub, "dataset", a->dataset, "dataset folder")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder for the body")->required();
  AddSplitOptions(sub, a->split);
  AddOption(sub, "--person", a->options.person, "person id in the dataset; -1: the one with most frames");
  AddOption(
      sub, "--template", a->body_template,
      "body that is fitted: mannequin, a folder of MakeHuman's base mesh, rigs and targets, or a .npz or .pkl file in SMPL's "
      "layout. Of several with commas between them held-out silhouettes choose; auto: the mannequin and all in the models' "
      "folder, in bodies");
  AddOption(sub, "--max-silhouettes", a->options.max_silhouettes,
            "time steps are thinned until no more are used; one is kept with all its cameras")
      ->check(CLI::Range(1, 100000));
  AddOption(sub, "--max-px", a->options.max_px, "longest edge of the person in the images that are fitted to")
      ->check(CLI::Range(64, 4096));
  AddOption(sub, "--texture-px", a->options.texture_px, "edge of each of the 24 charts of the texture")
      ->check(CLI::Range(8, 1024));
  AddChoice(
      sub, "--pose-by", a->pose_by,
      "images: all frames of the split are posed by the images of the training cameras; joints: those that are fitted to");
  AddFlag(sub, "--surface,!--no-surface", a->options.fit_surface,
          "fit the surface to the silhouettes; off: the lengths of the bones alone, to see what the surface is worth");
  AddFlag(sub, "--brightness,!--no-brightness", a->options.use_brightness,
          "align poses by the surface's brightness as well; kept only where held-out images agree");
  AddChoice(
      sub, "--dynamic", a->options.dynamic,
      "a surface that moves with the pose beyond skinning. linear: offsets linear in the bones' turns; network: offsets of a "
      "network of the posed surface, trained for minutes; auto: the better of them where it beats skinning in poses far "
      "from those it was trained on; off");
  AddOption(sub, "--network-steps", a->options.network_steps,
            "steps of each training of a network by --dynamic: five that are judged, and the one that is kept")
      ->check(CLI::Range(1, 1000000));
  AddOption(sub, "--fps", a->frame_rate_hz, "frames a second of the motion in body.glb")->check(CLI::Range(0.1, 1000.0));
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older body in --out");
  registry.Add(sub, "avatar fit", [a](CommandContext& context) { return RunFit(*a, context); });
  RegisterAvatarTexture(avatar, registry);
  RegisterAvatarEdit(avatar, registry);
}

}  // namespace mvstudio::cli
