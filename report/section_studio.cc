#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <regex>

#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/statistics.h"
#include "report/page/body_file.h"
#include "report/page/format.h"
#include "report/page/image.h"
#include "report/page/inside.h"
#include "report/scene/scene.h"
#include "report/sections.h"
#include "report/svg/rig_view.h"
#include "report/viewer/bundle.h"

/// The studio in 3D: what the page's viewer shows.
namespace mvstudio::report {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMaxCells = 1'200'000, kMaxBoards = 1500, kMaxSpans = 480, kChunkCells = 16'000, kMaxNotes = 6;

/// Bytes of a file of the run, or nothing.
std::string ReadBeside(const SectionContext& context, const std::string& folder, const std::string& name) {
  const std::string path = (fs::path(folder) / name).string();
  const auto file = context.options.follow_links ? (fs::path(context.data.root) / path).string()
                                                 : InsideFolder(context.data.root, path).value_or("");
  std::error_code ignored;
  if (file.empty() || !fs::is_regular_file(file, ignored)) return {};
  return ReadFile(file);
}

Value Numbers(const std::vector<double>& numbers) {
  Value list = Value::Array();
  for (const double number : numbers) list.Append(number);
  return list;
}

const Value& ByName(const Value& list, const std::string& name) {
  static const Value null;
  const auto found =
      std::find_if(list.items().begin(), list.items().end(), [&](const Value& v) { return v["name"].Text() == name; });
  return found == list.items().end() ? null : *found;
}

/// Whether the text has the name as a word; a short one only behind "camera".
bool Names(const std::string& text, const std::string& camera) {
  const auto is_word = [&](size_t i) {
    return i < text.size() && (std::isalnum(static_cast<unsigned char>(text[i])) != 0 || text[i] == '_');
  };
  const std::string sought = camera.size() < 3 ? "camera " + camera : camera;
  const size_t at = text.find(sought);
  return at != std::string::npos && (at == 0 || !is_word(at - 1)) && !is_word(at + sought.size());
}

/// Warnings and errors of the results that name the camera.
Value NotesOf(const RunData& data, const std::string& camera) {
  Value notes = Value::Array();
  for (const Stage& stage : data.stages) {
    for (const char* kind : {"errors", "warnings"}) {
      for (const Value& notice : stage.result[kind].items()) {
        const std::string text = notice["text"].Text();
        if (Names(text, camera) && notes.items().size() < kMaxNotes) notes.Append(stage.command + ": " + text);
      }
    }
  }
  return notes;
}

/// Degrees of the angle that `pixels` take about the axis: exact for a lens without distortion, and for an equidistant one.
double FieldOfView(const std::string& model, double pixels, double focal) {
  const bool fisheye = model.rfind("kannala", 0) == 0 || model.find("fisheye") != std::string::npos;
  return (fisheye ? pixels / focal : 2 * std::atan(pixels / 2 / focal)) * 180 / M_PI;
}

Value CameraScene(const SectionContext& context, const Value& camera, const ViewCamera& view) {
  const auto& c = view.center_in_world;
  const auto& r = view.world_from_cam;
  const double width = camera["size_px"].At(0).Number(), height = camera["size_px"].At(1).Number();
  const double fx = camera.Path("intrinsics.fx").Number(), fy = camera.Path("intrinsics.fy").Number();
  const std::string model = camera["model"].Text();
  Value scene = Value::Object();
  scene.Set("name", view.name).Set("model", model).Set("at", Numbers({c[0], c[1], c[2]}));
  scene.Set("axes", Numbers({r[0][0], r[1][0], r[2][0], r[0][1], r[1][1], r[2][1], r[0][2], r[1][2], r[2][2]}));
  scene.Set("half", Numbers({view.half_width, view.half_height})).Set("size", Numbers({width, height}));
  scene.Set("lens", Numbers({fx, fy, camera.Path("intrinsics.cx").Number(), camera.Path("intrinsics.cy").Number()}));
  scene.Set("fov", Numbers({FieldOfView(model, width, fx), FieldOfView(model, height, fy)}));
  if (ForClient(context.options)) return scene;
  for (const char* command : {"calibrate", "calib refine"}) {
    for (const Stage* stage : context.data.All(command)) {
      const Value& figures = ByName(stage->metrics()["cameras"], view.name);
      for (const char* key : {"rms_px", "holdout_rms_px", "focal_sigma_px", "coverage"}) {
        if (figures[key].IsNumber()) scene.Set(key, figures[key]);
      }
    }
  }
  return scene.Set("notes", NotesOf(context.data, view.name));
}

std::vector<ViewCamera> AddCameras(const SectionContext& context, Value* scene) {
  std::vector<ViewCamera> views;
  Value cameras = Value::Array();
  if (!context.data.calibrations.empty()) {
    for (const Value& camera : context.data.calibrations.front().value["cameras"].items()) {
      const ViewCamera view = ReadViewCamera(camera);
      const auto& c = view.center_in_world;
      if (!std::isfinite(c[0] + c[1] + c[2])) continue;
      cameras.Append(CameraScene(context, camera, view));
      views.push_back(view);
    }
  }
  scene->Set("cameras", cameras);
  return views;
}

/// Width and height in metres between the outer corners of a board as `--board` names it; {0, 0} when that is not told.
std::pair<double, double> BoardSize(const Value& argv) {
  static const std::regex kShape("([a-z]+):([0-9]{1,3})x([0-9]{1,3}):([0-9.]{1,12})(mm|cm|m)?(:.*)?");
  for (size_t i = 0; i + 1 < argv.items().size(); ++i) {
    std::smatch match;
    const std::string text = argv.At(i + 1).Text();
    if (argv.At(i).Text() != "--board" || text.size() > 200 || !std::regex_match(text, match, kShape)) continue;
    const double unit = match[5] == "mm" ? 1e-3 : match[5] == "cm" ? 1e-2 : 1;
    const int less = match[1] == "charuco" ? 2 : 1;  // squares and corners inside of them
    const double square = std::strtod(match[4].str().c_str(), nullptr) * unit;
    return {(std::stoi(match[2]) - less) * square, (std::stoi(match[3]) - less) * square};
  }
  return {0, 0};
}

void AddBoards(const SectionContext& context, Value* scene) {
  if (context.data.calibrations.empty()) return;
  const JsonFile& calibration = context.data.calibrations.front();
  const std::string text = ReadBeside(context, calibration.folder, "board_poses.csv");
  if (text.empty()) return;
  const TableFile table = ParseTable(text, "board_poses.csv");
  std::vector<int> columns;
  for (const char* name : {"x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "frame", "rms_px"})
    columns.push_back(table.Column(name));
  Value boards = Value::Array();
  const size_t stride = table.rows.size() / kMaxBoards + 1;
  for (size_t row = 0; row < table.rows.size(); row += stride) {
    std::vector<double> numbers;
    for (const int column : columns) numbers.push_back(table.Number(row, column));
    if (std::all_of(numbers.begin(), numbers.begin() + 7, [](double v) { return std::isfinite(v); }))
      boards.Append(Numbers(numbers));
  }
  std::pair<double, double> size{0, 0};
  for (const Stage* stage : context.data.All("calibrate")) {
    if (stage->folder == calibration.folder) size = BoardSize(stage->result["argv"]);
  }
  scene->Set("boards", boards).Set("board_size", Numbers({size.first, size.second}));
}

/// Steps, people and joints of a table by their index.
struct PeopleIndex {
  std::map<int64_t, size_t> steps;
  std::map<int64_t, size_t> people;
  std::map<std::string, size_t, std::less<>> joints;
};

std::optional<int64_t> WholeNumber(double number) {
  return std::abs(number) < 1e15 ? std::optional<int64_t>(static_cast<int64_t>(number)) : std::nullopt;
}

/// Everything but the covariances. Nobody where one time step alone would be too large for a page.
ScenePeople ReadPeople(const TableFile& table, PeopleIndex* index) {
  ScenePeople scene;
  const int frame = table.Column("frame"), person = table.Column("person"), joint = table.Column("joint"),
            status = table.Column("status"), views = table.Column("num_views"), rms = table.Column("rms_px"),
            sigma = table.Column("sigma_m");
  const int at[] = {table.Column("x_m"), table.Column("y_m"), table.Column("z_m")};
  const auto whole = [&](size_t row, int column) { return WholeNumber(column < 0 ? 0 : table.Number(row, column)); };
  if (joint < 0 || frame < 0) return scene;
  for (size_t row = 0; row < table.rows.size(); ++row) {
    const auto f = whole(row, frame), p = whole(row, person);
    if (!f || !p) continue;
    index->steps[*f] = 0, index->people[*p] = 0;
    if (index->joints.emplace(table.rows[row][joint], scene.joints.size()).second)
      scene.joints.push_back(table.rows[row][joint]);
  }
  for (auto& [number, place] : index->people) place = scene.people.size(), scene.people.push_back(number);
  const size_t of_step = scene.people.size() * scene.joints.size();
  if (of_step > kMaxCells) return {};
  const size_t stride = of_step == 0 ? 1 : (index->steps.size() * of_step - 1) / kMaxCells + 1;
  std::map<int64_t, size_t> kept;
  size_t count = 0;
  for (const auto& [number, place] : index->steps) {
    if (count++ % stride == 0) kept.emplace(number, scene.frames.size()), scene.frames.push_back(number);
  }
  index->steps = std::move(kept);
  scene.cells.resize(scene.frames.size() * of_step);
  for (size_t row = 0; row < table.rows.size(); ++row) {
    const auto f = whole(row, frame), p = whole(row, person);
    const auto step = f ? index->steps.find(*f) : index->steps.end();
    if (!p || step == index->steps.end() || (status >= 0 && table.rows[row][status] != "Ok")) continue;
    SceneJoint& cell = scene.At(step->second, index->people[*p], index->joints.find(table.rows[row][joint])->second);
    for (size_t i = 0; i < 3; ++i) cell.at_m[i] = table.Number(row, at[i]);
    const double seen = table.Number(row, views);
    cell.num_views = seen > 0 ? static_cast<int>(std::min(seen, 255.0)) : 0;
    const bool measured = cell.num_views > 0;  // else from a file of points alone, whose zeros say nothing
    cell.rms_px = measured ? table.Number(row, rms) : NAN;
    const double variance = measured ? std::pow(table.Number(row, sigma), 2) : NAN;
    cell.covariance_m2 = {variance, 0, 0, variance, 0, variance};
  }
  return scene;
}

/// Covariances of the file beside the points; without it they stay round.
bool ReadCovariances(const std::string& text, const PeopleIndex& index, ScenePeople* scene) {
  CsvReader csv("covariance.csv", text);
  bool any = false;
  const auto number = [](std::string_view cell) { return std::strtod(std::string(cell).c_str(), nullptr); };
  try {
    for (bool header = true; csv.NextLine(); header = false) {
      const auto& cells = csv.Cells();
      if (header || cells.size() != 9) continue;
      const auto step = index.steps.find(WholeNumber(number(cells[0])).value_or(-1));
      const auto person = index.people.find(WholeNumber(number(cells[1])).value_or(-1));
      const auto joint = index.joints.find(cells[2]);
      if (scene->cells.empty() || step == index.steps.end() || person == index.people.end() || joint == index.joints.end())
        continue;
      SceneJoint& cell = scene->At(step->second, person->second, joint->second);
      for (size_t i = 0; i < 6; ++i) cell.covariance_m2[i] = number(cells[3 + i]);
      any = true;
    }
  } catch (const FormatError&) {  // what was read so far is right
  }
  return any;
}

std::vector<std::pair<int, int>> BonesByIndex(const Value& skeleton, const PeopleIndex& index) {
  std::vector<std::pair<int, int>> bones;
  for (const NamedBone& bone : NamedBones(skeleton)) {
    const auto a = index.joints.find(bone.from), b = index.joints.find(bone.to);
    if (a != index.joints.end() && b != index.joints.end())
      bones.emplace_back(static_cast<int>(a->second), static_cast<int>(b->second));
  }
  return bones;
}

/// Metadata into `scene`, the chunks as elements.
std::string AddPeople(const ScenePeople& people, Value* scene) {
  Value frames = Value::Array(), names = Value::Array(), bones = Value::Array(), ids = Value::Array(), spans = Value::Array();
  for (const int64_t frame : people.frames) frames.Append(frame);
  for (const std::string& joint : people.joints) names.Append(joint);
  for (const auto& [a, b] : people.bones) bones.Append(Value::Array().Append(a).Append(b));
  for (const int64_t id : people.people) ids.Append(id);
  for (const SceneSpan& span : SpansOf(people, kMaxSpans)) {
    spans.Append(Value::Array()
                     .Append(static_cast<int64_t>(span.first))
                     .Append(static_cast<int64_t>(span.worst))
                     .Append(std::round(span.rms_px * 100) / 100)
                     .Append(std::round(span.missing * 1000) / 1000)
                     .Append(static_cast<int64_t>(span.emptiest)));
  }
  const size_t of_step = std::max<size_t>(1, people.people.size() * people.joints.size());
  const size_t length = std::max<size_t>(1, kChunkCells / of_step);
  scene->Set("frames", frames).Set("joints", names).Set("bones", bones).Set("people", ids).Set("spans", spans);
  scene->Set("chunk", static_cast<int64_t>(length)).Set("rate_hz", people.rate_hz);
  std::string html;
  for (size_t first = 0; first < people.frames.size(); first += length) {
    html += "<i data-chunk=\"" + Base64(PackPeople(people, first, std::min(length, people.frames.size() - first))) + "\"></i>";
  }
  return html;
}

/// Height of the floor along the axis: nearly the lowest joint, else the lowest camera or board.
double FloorOf(const std::vector<ViewCamera>& cameras, const Value& boards, const ScenePeople& people, int up) {
  const size_t axis = static_cast<size_t>(std::abs(up) - 1);
  const double sign = up > 0 ? 1 : -1;
  std::vector<double> heights;
  const size_t stride = people.cells.size() / 20000 + 1;
  for (size_t i = 0; i < people.cells.size(); i += stride) heights.push_back(sign * people.cells[i].at_m[axis]);
  heights = FiniteValues(heights);
  if (!heights.empty()) return LinearQuantile(heights, 0.005);
  for (const Value& board : boards.items()) heights.push_back(sign * board.At(axis).Number());
  for (const ViewCamera& camera : cameras) heights.push_back(sign * camera.center_in_world[axis]);
  return heights.empty() ? 0 : LinearQuantile(heights, 0);
}

/// The bytes of a result's first output of a role that may be embedded; empty where there is none.
std::string OutputOfRole(SectionContext* context, const Stage& stage, const char* role, bool (*is_right)(std::string_view)) {
  for (const Value& output : stage.result["outputs"].items()) {
    if (output["role"].Text() != role) continue;
    std::string bytes = ReadOutput(context, stage, output, is_right, "no file of a fitted body");
    if (!bytes.empty()) return bytes;
  }
  return {};
}

/// The fitted body over time, and its colours, as elements: the first that has colours, else the first; empty without one. The
/// viewer takes Gaussians, and a body where there is no element, from the player of Gaussians.
std::string BodyOverTime(SectionContext* context) {
  const auto has_colours = [](const Stage& stage) {
    const auto& outputs = stage.result["outputs"].items();
    return std::any_of(outputs.begin(), outputs.end(), [](const Value& o) { return o["role"].Text() == "body-texture"; });
  };
  for (const bool coloured : {true, false}) {
    for (const Stage& stage : context->data.stages) {
      if (has_colours(stage) != coloured) continue;
      const std::string motion = OutputOfRole(context, stage, "body-motion", IsBodyFile);
      if (motion.empty()) continue;
      const std::string texture = OutputOfRole(context, stage, "body-texture", IsBodyTexture);
      return "<i data-body=\"" + Base64(motion) + "\"></i>" +
             (texture.empty() ? "" : "<i data-texture=\"" + Base64(texture) + "\"></i>");
    }
  }
  return {};
}

/// Frames that an avatar was scored on with the lowest SSIM of their images, [frame, SSIM], the worst first.
Value HeldOutFrames(const RunData& data) {
  std::map<int64_t, double> lowest;
  for (const Stage* stage : data.All("avatar eval")) {
    for (const Value& image : stage->metrics()["pictures"].items()) {
      const auto frame = WholeNumber(image["frame"].Number());
      const double ssim = image["ssim"].Number();
      if (frame && std::isfinite(ssim)) lowest[*frame] = lowest.count(*frame) > 0 ? std::min(lowest[*frame], ssim) : ssim;
    }
  }
  std::vector<std::pair<double, int64_t>> sorted;
  for (const auto& [frame, ssim] : lowest) sorted.emplace_back(ssim, frame);
  std::sort(sorted.begin(), sorted.end());
  Value frames = Value::Array();
  for (const auto& [ssim, frame] : sorted) frames.Append(Value::Array().Append(frame).Append(ssim));
  return frames;
}

/// The worst time steps below the viewer, the very worst for the top of the page.
std::string TimeStepLinks(SectionContext* context, const ScenePeople& people) {
  constexpr size_t kShown = 3;
  if (ForClient(context->options) || context->data.points.empty()) return {};
  const TableFile& table = context->data.points.front().table;
  const WorstTimeSteps all = FindWorstTimeSteps(people, table, kShown), first = FindWorstTimeSteps(people, table, 1);
  if (!first.residuals.empty()) context->worst_step = "largest residuals at " + first.residuals;
  if (!first.missing.empty())
    context->worst_step += (first.residuals.empty() ? "" : "; ") + ("most joints without a position at " + first.missing);
  return (all.residuals.empty() ? "" : "<p>Largest residuals: " + all.residuals + ".</p>\n") +
         (all.missing.empty() ? "" : "<p>Most joints without a position: " + all.missing + ".</p>\n");
}

}  // namespace

Section StudioSection(SectionContext* context) {
  const RunData& data = context->data;
  Section section{"studio", "The studio in 3D", ""};
  Value scene = Value::Object();
  const std::vector<ViewCamera> cameras = AddCameras(*context, &scene);
  ScenePeople people;
  std::string chunks;
  try {
    AddBoards(*context, &scene);
    if (!data.points.empty()) {
      const CsvFile& points = data.points.front();
      PeopleIndex index;
      people = ReadPeople(points.table, &index);
      people.bones = BonesByIndex(SkeletonOf(data, points), index);
      for (const JsonFile& pose : data.poses) {
        if (pose.folder == points.folder) people.rate_hz = std::max(0.0, pose.value["frame_rate_hz"].Number(0));
      }
      scene.Set("round", !ReadCovariances(ReadBeside(*context, points.folder, "covariance.csv"), index, &people));
      chunks = AddPeople(people, &scene);
      if (!ForClient(context->options)) scene.Set("held_out", HeldOutFrames(data));
    }
  } catch (const Error& error) {
    context->warnings.push_back({"REP-FILE", error.what(), "run the command that writes this file again"});
  }
  if (cameras.empty() && people.frames.empty()) return section;
  const int up = UpAxis(cameras);
  scene.Set("up", up).Set("floor", FloorOf(cameras, scene["boards"], people, up));
  NeedScript(context, ViewerScript());
  section.body_html =
      "<div class=\"studio\" data-scene=\"" + EscapeHtml(scene.Dump()) + "\">" +
      ParagraphHtml(
          "The view in 3D needs WebGL and scripts, which are not at hand here. The drawn figures of the rig show the same.",
          "muted") +
      "<div hidden>" + chunks + BodyOverTime(context) + "</div></div>\n" + TimeStepLinks(context, people);
  return section;
}

}  // namespace mvstudio::report
