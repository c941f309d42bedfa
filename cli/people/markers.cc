#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/markers/describe.h"

namespace mvstudio::cli {
namespace {

template <class Options>
void AddPlaces(CLI::App* sub, Options& options, OutputKind kind, const char* out) {
  AddOption(sub, "points", options.points.path,
            "folder of `triangulate`, its points.csv or pose3d.json, or a file: .trc, .c3d, .bvh, .csv, .sto, .npz, .npy, .h5; "
            "or a folder of FreeMoCap, DeepLabCut or EasyMocap with 3D joints");
  AddOptions(sub, options.points);
  AddFlag(sub, "--overwrite", options.overwrite, "replace the output");
  AddOutput(sub, "--out", options.out, kind, out);
}

void AddSmoothing(CLI::App* sub, stages::MarkerOptions& options) {
  AddOption(sub, "--frame-rate", options.rate_hz, "frames a second, e.g. 60; what the input states unless given");
  AddOption(sub, "--filter", options.filter, "as of `markers`")->capture_default_str();
  AddOption(sub, "--fill", options.fill_frames, "gaps of at most so many frames are filled; 0: none")->capture_default_str();
}

void AddConvert(CLI::App* parent, Registry& registry) {
  const auto options = std::make_shared<stages::MarkerConvertOptions>();
  CLI::App* sub = parent->add_subcommand("convert", "3D points from one format into another");
  AddPlaces(sub, *options, OutputKind::kFile, "a file where its name ends as the format's, else a folder for person0.trc, …");
  AddOption(
      sub, "--to", options->how.to,
      "trc, c3d, bvh, csv (a row per point), wide (a row per frame), npz, sto or pose3d (a folder as of triangulate); as the "
      "output's name ends unless given");
  AddOption(sub, "--frame-rate", options->points.rate_hz, "frames a second, e.g. 60; what the input states unless given");
  AddOption(sub, "--to-unit", options->how.unit, "m, cm, mm or in: of the output; the format's custom unless given");
  AddOption(sub, "--to-up", options->how.up, "x, y or z: the axis that is up in the output; the format's custom unless given");
  AddOption(sub, "--person", options->how.person, "the person that is written; -1: the only one, and into a folder all")
      ->capture_default_str();
  registry.Add(sub, "markers convert", [options](CommandContext&) { return Describe(stages::RunMarkerConvert(*options)); });
}

void AddAngles(CLI::App* parent, Registry& registry) {
  const auto options = std::make_shared<stages::MarkersOptions>();
  options->how.to = "angles";
  CLI::App* sub = parent->add_subcommand("angles", "joint angles of people: a table with deviations, and OpenSim's .mot");
  AddPlaces(sub, *options, OutputKind::kFolder, "folder for person0.angles.csv and .mot");
  AddSmoothing(sub, options->how);
  registry.Add(sub, "markers angles", [options](CommandContext&) { return Describe(stages::RunMarkers(*options)); });
}

void AddEvents(CLI::App* parent, Registry& registry) {
  const auto options = std::make_shared<stages::MarkersOptions>();
  CLI::App* sub = parent->add_subcommand("events", "heel strikes and toe offs, proposed");
  AddPlaces(sub, *options, OutputKind::kFolder, "folder for person0.events.csv");
  AddSmoothing(sub, options->how);
  registry.Add(sub, "markers events", [options](CommandContext&) { return Describe(stages::RunMarkerEvents(*options)); });
}

}  // namespace

void RegisterMarkers(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::MarkersOptions>();
  CLI::App* sub = app.add_subcommand("markers",
                                     "3D joints -> .trc, .c3d, .bvh, tables of markers, joint angles, gait events; filled and "
                                     "filtered; OpenSim's set-up files");
  // The first command of the registry that was parsed is run: those below come first.
  AddConvert(sub, registry);
  AddAngles(sub, registry);
  AddEvents(sub, registry);
  AddPlaces(sub, *options, OutputKind::kFolder, "folder for person0.trc, …, and markers.html, the curves before and after");
  AddOptions(sub, options->how);
  registry.Add(sub, "markers", [options](CommandContext&) { return Describe(stages::RunMarkers(*options)); });
}

}  // namespace mvstudio::cli
