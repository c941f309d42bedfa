#include "app/people/marker_export.h"
#include "body/skeleton.h"
#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  std::string points, skeleton, out;
  bool overwrite = false;
  app::MarkerOptions options;
};

CommandResult Run(const Arguments& arguments) {
  CheckMarkerOptions(arguments.options);
  CommandResult result;
  AtomicFolder folder(arguments.out, arguments.overwrite, {arguments.points, arguments.skeleton});
  dataset::Pose3d pose = dataset::ReadPose3d(arguments.points);
  result.inputs.push_back(arguments.points);
  if (!arguments.skeleton.empty()) UseSkeleton(body::SkeletonFrom(arguments.skeleton), arguments.points, &pose);
  if (body::IsSkeletonFile(arguments.skeleton)) result.inputs.push_back(arguments.skeleton);
  app::CheckMarkerWorld(pose.world, arguments.options, &result);
  const auto work = PrepareMarkers(pose, arguments.options, arguments.points);
  WriteMarkers(work, SkeletonOf(pose), arguments.options, folder.work_path(), arguments.out, &result);
  folder.Commit();
  result.folder = arguments.out;
  return result;
}

}  // namespace

void RegisterMarkers(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand(
      "markers", "3D joints -> .trc, .c3d, .bvh and tables of markers, filled and filtered; OpenSim's set-up files");
  AddOption(sub, "points", arguments->points, "folder of `triangulate`: points.csv and pose3d.json")->required();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder,
            "folder for person0.trc, …, and markers.html, the curves before and after")
      ->required();
  AddOptions(sub, arguments->options);
  AddSkeletonOption(sub, arguments->skeleton, "bones of the joints, where the folder does not state them");
  AddFlag(sub, "--overwrite", arguments->overwrite, "replace the output folder");
  registry.Add(sub, "markers", [arguments](CommandContext&) { return Run(*arguments); });
}

}  // namespace mvstudio::cli
