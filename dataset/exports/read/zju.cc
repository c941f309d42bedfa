#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/arrays/pickle_machine.h"
#include "dataset/exports/read/layout_cameras.h"

/// annots.npy: numpy's file of one pickled dict. `cams` holds K, D, R, T (millimetres) of every camera, as lists of arrays, one
/// array, or lists of numbers; `ims` the paths of the images of every frame.
namespace mvstudio::exports::internal {
namespace {

using dataset::internal::PickleValue;
using Kind = dataset::internal::PickleValue::Kind;

constexpr int kMostLevels = 4;  // values may refer to each other in circles

[[noreturn]] void Fail(const std::string& path, const std::string& where, const std::string& what) {
  throw FormatError(path, where, what);
}

/// The pickle after numpy's header.
std::string PickleOf(const std::string& path) {
  const std::string bytes = ReadFile(path);
  const std::string_view magic = "\x93NUMPY";
  if (bytes.size() < 12 || bytes.compare(0, magic.size(), magic) != 0) Fail(path, "", "is no .npy file");
  const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<unsigned char>(bytes[i])); };
  const bool is_long = bytes[6] >= 2;
  const size_t start = is_long ? 12 : 10,
               length = byte(8) + (byte(9) << 8) + (is_long ? (byte(10) << 16) + (byte(11) << 24) : 0);
  if (bytes.size() < start + length) Fail(path, "", "is cut short");
  const std::string header = bytes.substr(start, length);
  if (header.find("|O") == std::string::npos)
    Fail(path, "", "holds an array of numbers, not the dict of ZJU-MoCap's annots.npy");
  return bytes.substr(start + length);
}

/// The value itself, or that of an array of one object.
const PickleValue& Unwrapped(const PickleValue& value, const std::string& path) {
  if (value.kind == Kind::kList && value.items.size() == 1) return *value.items[0];
  if (value.kind != Kind::kArray) return value;
  const PickleValue* state = value.state;
  const bool objects = state && state->kind == Kind::kTuple && state->items.size() == 5 && state->items[4]->kind == Kind::kList;
  if (!objects || state->items[4]->items.size() != 1) Fail(path, "", "is not the dict of ZJU-MoCap's annots.npy");
  return *state->items[4]->items[0];
}

const PickleValue& Member(const PickleValue& dict, const char* key, const std::string& path, const std::string& where) {
  const PickleValue* found = dict.kind == Kind::kDict ? dict.Find(key) : nullptr;
  if (!found) Fail(path, where + key, "is missing; ZJU-MoCap's annots.npy holds cams.K, D, R, T and ims");
  return *found;
}

/// All numbers of nested lists and arrays, row by row.
void AddNumbers(const PickleValue& value, int level, const std::string& path, const std::string& where,
                std::vector<double>* numbers) {
  if (value.kind == Kind::kNumber) {
    numbers->push_back(value.number);
  } else if (value.kind == Kind::kArray) {
    const NpyArray array = dataset::internal::ArrayOf(value, path, where);
    numbers->insert(numbers->end(), array.values.begin(), array.values.end());
  } else if ((value.kind == Kind::kList || value.kind == Kind::kTuple) && level < kMostLevels) {
    for (const PickleValue* item : value.items) AddNumbers(*item, level + 1, path, where, numbers);
  } else {
    Fail(path, where, "is no list of numbers");
  }
}

std::vector<double> Numbers(const PickleValue& cams, const char* key, const std::string& path) {
  std::vector<double> numbers;
  AddNumbers(Member(cams, key, path, "cams."), 0, path, std::string("cams.") + key, &numbers);
  return numbers;
}

/// The paths of the first frame's images; empty where there are none.
std::vector<std::string> ImagesOf(const PickleValue& annots) {
  std::vector<std::string> images;
  const PickleValue* ims = annots.Find("ims");
  if (!ims || ims->kind != Kind::kList || ims->items.empty() || ims->items[0]->kind != Kind::kDict) return images;
  const PickleValue* of_frame = ims->items[0]->Find("ims");
  if (!of_frame || (of_frame->kind != Kind::kList && of_frame->kind != Kind::kTuple)) return images;
  for (const PickleValue* item : of_frame->items) images.emplace_back(item->kind == Kind::kText ? item->text : "");
  return images;
}

std::vector<double> Part(const std::vector<double>& numbers, size_t camera, size_t count) {
  const auto from = numbers.begin() + static_cast<std::ptrdiff_t>(camera * count);
  return {from, from + static_cast<std::ptrdiff_t>(count)};
}

}  // namespace

geometry::Rig ReadZju(const std::string& path, const calib::ReadOptions& options) {
  constexpr double kMetresPerMm = 1e-3;
  const std::string file = FileOf(path, "annots.npy"), pickle = PickleOf(file);
  dataset::internal::PickleMachine machine(pickle, file);
  const PickleValue& annots = Unwrapped(machine.Run(), file);
  const PickleValue& cams = Member(annots, "cams", file, "");
  const std::vector<double> k = Numbers(cams, "K", file), d = Numbers(cams, "D", file), r = Numbers(cams, "R", file),
                            t = Numbers(cams, "T", file);
  const size_t count = k.size() / 9;
  if (count == 0 || k.size() != 9 * count || r.size() != 9 * count || t.size() != 3 * count || d.size() % count != 0)
    Fail(file, "cams", "K, D, R and T are not of the same number of cameras");
  const std::vector<std::string> images = ImagesOf(annots);
  std::vector<LayoutCamera> cameras;
  for (size_t i = 0; i < count; ++i) {
    LayoutCamera camera;
    camera.place_in_export = i, camera.place = {file, "camera " + std::to_string(i)};
    if (i < images.size()) camera.image = images[i];
    camera.name = std::filesystem::path(camera.image).parent_path().filename().string();
    camera.k = MatrixOfRows(Part(k, i, 9), 3, 3, camera.place);
    camera.distortion =
        MatrixOfRows(Part(d, i, d.size() / count), static_cast<Eigen::Index>(d.size() / count), 1, camera.place);
    camera.cam_from_world = MakeTransform(MatrixOfRows(Part(r, i, 9), 3, 3, camera.place),
                                          kMetresPerMm * MatrixOfRows(Part(t, i, 3), 3, 1, camera.place), camera.place);
    cameras.push_back(std::move(camera));
  }
  return RigOfCameras(cameras, FolderOf(path, 0), options);
}

}  // namespace mvstudio::exports::internal
