#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

/// A user study with forced choices: which of two images is closer to the truth shown between them.
namespace mvstudio::report {

inline constexpr char kStudySchema[] = "mvstudio.study/1";
inline constexpr char kStudyAnswersSchema[] = "mvstudio.study-answers/1";

/// One question: the bytes of three PNG or JPEG files.
struct StudyImage {
  std::string name;
  std::string truth, a, b;
};

/// Images with the same file name in three folders (without subfolders), sorted; names that are not in all three are
/// listed in `unmatched`. Throws IoError for missing folders. Throws FormatError when no name is in all three, for content
/// that is not an image, for PNG files of different sizes, and unless `follow_links` for links that lead out of a folder.
std::vector<StudyImage> ReadStudyImages(const std::string& truth_folder, const std::string& a_folder,
                                        const std::string& b_folder, std::vector<std::string>* unmatched,
                                        bool follow_links = false);
/// `count` of them, evenly spaced in the list; all when there are fewer.
std::vector<StudyImage> ThinStudy(const std::vector<StudyImage>& images, int count);

struct StudySpec {
  std::string title;
  std::array<std::string, 2> methods;  ///< names of a and b; they appear in the answers, not on the page
  uint64_t seed = 1;                   ///< order of the questions and sides
  std::vector<StudyImage> images;
};

struct Study {
  std::string sha256;  ///< of methods, images, order and sides: answers name it
  std::string html;    ///< one self-contained document; its script is allowed by its digest, the network is not
  std::string json;    ///< the key: schema, sha256, methods, and for each question the image and the method on the left
};

/// Each method is on the left in half of the questions. The page holds a seal for each question from which
/// `ReadStudyAnswers` determines what was on the left; neither its text nor its data reveal it. Throws UsageError without
/// images and for equal names.
Study MakeStudy(const StudySpec& spec);

/// The seal of a question: a digest of the study, the image and the method on the left.
std::string StudySeal(const std::string& study_sha256, const std::string& image, const std::string& left_method);

}  // namespace mvstudio::report
