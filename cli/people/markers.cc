#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "stages/people/marker_export.h"
#include "stages/people/points_input.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  stages::PointsArguments points;
  std::string out;
  bool overwrite = false;
  stages::MarkerOptions options;
  stages::ConvertOptions convert;
};

std::vector<std::string> InputsOf(const Arguments& arguments) { return {arguments.points.path, arguments.points.skeleton}; }

void RequireArguments(const Arguments& arguments) {
  if (arguments.points.path.empty())
    throw UsageError("name the points: a folder of triangulate, its points.csv, or a file of markers");
  if (arguments.out.empty()) throw UsageError("--out is required: the folder (or the file) to write, e.g. --out markers");
}

stages::PointsInput ReadInput(Arguments* arguments, CommandResult* result) {
  if (arguments->options.rate_hz != 0) arguments->points.rate_hz = arguments->options.rate_hz;
  stages::PointsInput input = ReadPointsInput(arguments->points, result);
  arguments->options.rate_hz = input.pose.frame_rate_hz;
  if (!input.is_run)
    result->text += "read in " + input.unit + ", " + input.up + Format(" up, %g frames a second\n", input.pose.frame_rate_hz);
  return input;
}

CommandResult Run(Arguments arguments) {
  RequireArguments(arguments);
  CheckMarkerOptions(arguments.options);
  CommandResult result;
  AtomicFolder folder(arguments.out, arguments.overwrite, InputsOf(arguments));
  const stages::PointsInput input = ReadInput(&arguments, &result);
  Append(stages::MarkerWorldDoubts(input.pose.world, arguments.options), &result.warnings);
  const auto work = PrepareMarkers(input.pose, arguments.options, arguments.points.path);
  result.Add(DescribeMarkers(WriteMarkers(work, input.pose, arguments.options, folder.work_path(), arguments.out)));
  folder.Commit();
  result.folder = arguments.out;
  return result;
}

CommandResult RunAngles(Arguments arguments) {
  arguments.options.to = "angles";
  return Run(std::move(arguments));
}

CommandResult RunEvents(Arguments arguments) {
  RequireArguments(arguments);
  arguments.options.to = "csv";
  CheckMarkerOptions(arguments.options);
  CommandResult result;
  AtomicFolder folder(arguments.out, arguments.overwrite, InputsOf(arguments));
  const stages::PointsInput input = ReadInput(&arguments, &result);
  const auto work = PrepareMarkers(input.pose, arguments.options, arguments.points.path);
  WriteGaitEvents(work, input.pose, folder.work_path(), arguments.out, &result);
  folder.Commit();
  result.folder = arguments.out;
  return result;
}

CommandResult RunConvert(Arguments arguments) {
  RequireArguments(arguments);
  CommandResult result;
  if (IsFileOfFormat(arguments.convert, arguments.out)) {
    const OutputFiles place({arguments.out}, InputsOf(arguments));
    const stages::PointsInput input = ReadInput(&arguments, &result);
    ConvertMarkers(input.pose, arguments.convert, arguments.out, "", &result);
    return result;
  }
  AtomicFolder folder(arguments.out, arguments.overwrite, InputsOf(arguments));
  const stages::PointsInput input = ReadInput(&arguments, &result);
  ConvertMarkers(input.pose, arguments.convert, arguments.out, folder.work_path(), &result);
  folder.Commit();
  result.folder = arguments.out;
  return result;
}

constexpr char kPointsHelp[] =
    "folder of `triangulate`, its points.csv or pose3d.json, or a file: .trc, .c3d, .bvh, .csv, .sto, .npz, .npy, .h5; or a "
    "folder "
    "of FreeMoCap, DeepLabCut or EasyMocap with 3D joints";

void AddInput(CLI::App* sub, Arguments& arguments) {
  AddOption(sub, "points", arguments.points.path, kPointsHelp);
  AddOption(sub, "--unit,--marker-unit", arguments.points.unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: of such a file, instead of what it states");
  AddOption(sub, "--up", arguments.points.up, "x, y or z: the axis that is up in such a file, instead of what it states");
  AddOption(sub, "--frames", arguments.points.frames, "80-99 or 1,4,7-9; all unless given");
  AddOption(sub, "--skeleton", arguments.points.skeleton,
            "bones of the joints, where the input does not state them: a name that triangulate knows, or a file FILE.toml "
            "(docs/formats.md)");
  AddFlag(sub, "--overwrite", arguments.overwrite, "replace the output");
}

void AddSmoothing(CLI::App* sub, stages::MarkerOptions& options) {
  AddOption(sub, "--frame-rate", options.rate_hz, "frames a second, e.g. 60; what the input states unless given");
  AddOption(sub, "--filter", options.filter, "as of `markers`")->capture_default_str();
  AddOption(sub, "--fill", options.fill_frames, "gaps of at most so many frames are filled; 0: none")->capture_default_str();
}

std::shared_ptr<Arguments> AddChild(CLI::App* parent, const char* name, const char* help, const char* out, OutputKind kind,
                                    CLI::App** sub) {
  auto arguments = std::make_shared<Arguments>();
  *sub = parent->add_subcommand(name, help);
  AddInput(*sub, *arguments);
  AddOutput(*sub, "--out", arguments->out, kind, out);
  return arguments;
}

void AddConvert(CLI::App* parent, Registry& registry) {
  CLI::App* sub = nullptr;
  const auto arguments =
      AddChild(parent, "convert", "3D points from one format into another",
               "a file where its name ends as the format's, else a folder for person0.trc, …", OutputKind::kFile, &sub);
  AddOption(
      sub, "--to", arguments->convert.to,
      "trc, c3d, bvh, csv (a row per point), wide (a row per frame), npz, sto or pose3d (a folder as of triangulate); as the "
      "output's name ends unless given");
  AddOption(sub, "--frame-rate", arguments->options.rate_hz, "frames a second, e.g. 60; what the input states unless given");
  AddOption(sub, "--to-unit", arguments->convert.unit, "m, cm, mm or in: of the output; the format's custom unless given");
  AddOption(sub, "--to-up", arguments->convert.up,
            "x, y or z: the axis that is up in the output; the format's custom unless given");
  AddOption(sub, "--person", arguments->convert.person, "the person that is written; -1: the only one, and into a folder all")
      ->capture_default_str();
  registry.Add(sub, "markers convert", [arguments](CommandContext&) { return RunConvert(*arguments); });
}

}  // namespace

void RegisterMarkers(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("markers",
                                     "3D joints -> .trc, .c3d, .bvh, tables of markers, joint angles, gait events; filled and "
                                     "filtered; OpenSim's set-up files");
  // The first command of the registry that was parsed is run: those below come first.
  AddConvert(sub, registry);
  CLI::App* child = nullptr;
  const auto angles = AddChild(sub, "angles", "joint angles of people: a table with deviations, and OpenSim's .mot",
                               "folder for person0.angles.csv and .mot", OutputKind::kFolder, &child);
  AddSmoothing(child, angles->options);
  registry.Add(child, "markers angles", [angles](CommandContext&) { return RunAngles(*angles); });
  const auto events = AddChild(sub, "events", "heel strikes and toe offs, proposed", "folder for person0.events.csv",
                               OutputKind::kFolder, &child);
  AddSmoothing(child, events->options);
  registry.Add(child, "markers events", [events](CommandContext&) { return RunEvents(*events); });
  AddInput(sub, *arguments);
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder,
            "folder for person0.trc, …, and markers.html, the curves before and after");
  AddOptions(sub, arguments->options);
  registry.Add(sub, "markers", [arguments](CommandContext&) { return Run(*arguments); });
}

}  // namespace mvstudio::cli
