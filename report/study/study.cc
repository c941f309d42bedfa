#include "report/study/study.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/random.h"
#include "report/page/image.h"
#include "report/page/inside.h"
#include "report/page/value.h"
#include "report/study/study_page.h"

namespace mvstudio::report {
namespace {

namespace fs = std::filesystem;

constexpr size_t kSealDigits = 24;

std::map<std::string, std::string> ImagesOf(const std::string& folder, bool follow_links) {
  RequireFolder(folder, "; give a folder of images");
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (!follow_links && !InsideFolder(folder, entry.path().filename().string()))
      throw FormatError(entry.path().string(), "",
                        "is a link that leads out of the folder, and is not read; option 'follow-links' reads through it");
    if (entry.is_regular_file() && (extension == ".png" || extension == ".jpg" || extension == ".jpeg"))
      files[entry.path().stem().string()] = entry.path().string();
  }
  if (files.empty()) throw IoError(folder, "holds no PNG or JPEG images");
  return files;
}

std::string ReadScoredImage(const std::string& path) {
  std::string bytes = ReadFile(path);
  if (ImageType(bytes).empty()) throw FormatError(path, "", "is neither PNG nor JPEG");
  return bytes;
}

void RequireSameSize(const std::string& path, const std::string& truth, const std::string& other) {
  int width = 0, height = 0, other_width = 0, other_height = 0;
  if (!PngSize(truth, &width, &height) || !PngSize(other, &other_width, &other_height)) return;
  if (width == other_width && height == other_height) return;
  throw FormatError(path, "",
                    "is " + std::to_string(other_width) + "x" + std::to_string(other_height) + ", its truth is " +
                        std::to_string(width) + "x" + std::to_string(height));
}

/// Fisher and Yates.
template <class T>
void Shuffle(std::vector<T>* items, Rng* rng) {
  for (size_t i = items->size(); i > 1; --i) std::swap((*items)[i - 1], (*items)[rng->Index(static_cast<int64_t>(i))]);
}

/// The questions in the order of the page.
std::vector<StudyQuestion> Questions(const StudySpec& spec) {
  Rng rng(spec.seed);
  std::vector<size_t> order(spec.images.size());
  std::vector<char> a_left(order.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i, a_left[i] = i % 2 == 0;
  if (order.size() % 2 == 1) a_left.back() = rng.Index(2) == 0;
  Shuffle(&order, &rng);
  Shuffle(&a_left, &rng);
  std::vector<StudyQuestion> questions;
  for (size_t i = 0; i < order.size(); ++i) questions.push_back({&spec.images[order[i]], a_left[i] != 0, ""});
  return questions;
}

std::string DigestOf(const StudySpec& spec, const std::vector<StudyQuestion>& questions) {
  const auto hex = [](const std::string& bytes) { return Sha256Hex(bytes.data(), bytes.size()); };
  std::string text = std::string(kStudySchema) + "\n" + spec.methods[0] + "\n" + spec.methods[1] + "\n";
  for (const StudyQuestion& question : questions) {
    const StudyImage& image = *question.image;
    text += image.name + " " + (question.a_left ? "a" : "b") + " " + hex(image.truth) + " " + hex(image.a) + " " +
            hex(image.b) + "\n";
  }
  return hex(text);
}

std::string KeyJson(const StudySpec& spec, const Study& study, const std::vector<StudyQuestion>& questions) {
  Value list = Value::Array();
  for (const StudyQuestion& question : questions) {
    list.Append(Value::Object()
                    .Set("picture", question.image->name)
                    .Set("left", spec.methods[question.a_left ? 0 : 1])
                    .Set("right", spec.methods[question.a_left ? 1 : 0]));
  }
  Value key = Value::Object()
                  .Set("schema", kStudySchema)
                  .Set("sha256", study.sha256)
                  .Set("title", spec.title)
                  .Set("methods", Value::Array().Append(spec.methods[0]).Append(spec.methods[1]))
                  .Set("questions", list);
  return key.Dump(1) + "\n";
}

}  // namespace

std::vector<StudyImage> ReadStudyImages(const std::string& truth_folder, const std::string& a_folder,
                                        const std::string& b_folder, std::vector<std::string>* unmatched, bool follow_links) {
  const auto truths = ImagesOf(truth_folder, follow_links), a = ImagesOf(a_folder, follow_links),
             b = ImagesOf(b_folder, follow_links);
  std::vector<StudyImage> images;
  for (const auto& [name, path] : truths) {
    const auto of_a = a.find(name), of_b = b.find(name);
    if (of_a == a.end() || of_b == b.end()) {
      unmatched->push_back(name);
      continue;
    }
    images.push_back({name, ReadScoredImage(path), ReadScoredImage(of_a->second), ReadScoredImage(of_b->second)});
    RequireSameSize(of_a->second, images.back().truth, images.back().a);
    RequireSameSize(of_b->second, images.back().truth, images.back().b);
  }
  for (const auto* others : {&a, &b}) {
    for (const auto& [name, path] : *others) {
      if (!truths.count(name)) unmatched->push_back(name);
    }
  }
  if (images.empty())
    throw FormatError(truth_folder, "", "has no file name in common with both " + a_folder + " and " + b_folder);
  return images;
}

std::vector<StudyImage> ThinStudy(const std::vector<StudyImage>& images, int count) {
  const size_t number = std::min(images.size(), static_cast<size_t>(std::max(count, 1)));
  std::vector<StudyImage> chosen;
  for (size_t k = 0; k < number; ++k) chosen.push_back(images[(2 * k + 1) * images.size() / (2 * number)]);
  return chosen;
}

std::string StudySeal(const std::string& study_sha256, const std::string& image, const std::string& left_method) {
  const std::string text = study_sha256 + "\n" + image + "\n" + left_method;
  return Sha256Hex(text.data(), text.size()).substr(0, kSealDigits);
}

Study MakeStudy(const StudySpec& spec) {
  if (spec.images.empty()) throw UsageError("a study needs at least one image");
  if (spec.methods[0].empty() || spec.methods[0] == spec.methods[1])
    throw UsageError("the two methods of a study need different names; give them as NAME=FOLDER");
  std::vector<StudyQuestion> questions = Questions(spec);
  Study study;
  study.sha256 = DigestOf(spec, questions);
  for (StudyQuestion& question : questions)
    question.seal = StudySeal(study.sha256, question.image->name, spec.methods[question.a_left ? 0 : 1]);
  study.html = StudyPageHtml(spec, study.sha256, questions);
  study.json = KeyJson(spec, study, questions);
  return study;
}

}  // namespace mvstudio::report
