#include "calib/board/draw.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>

#include "calib/board/print.h"
#include "calib/board/propose.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/fields.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

constexpr double kPtPerMm = 72 / 25.4;
constexpr double kPrinterMargin = 5;  // mm that printers leave white
constexpr double kStrip = 17;         // mm below the board for ruler and text
constexpr double kRuler = 100, kRulerRoom = 112;
constexpr double kFont = 2.8;        // mm
constexpr double kCharWidth = 0.56;  // of the font's height, Helvetica's digits and small letters
constexpr double kMaxPixels = 4e8;

constexpr ChoiceWords<Paper, 6> kPapers = {{{Paper::kA4, "a4"},
                                            {Paper::kA3, "a3"},
                                            {Paper::kA2, "a2"},
                                            {Paper::kA1, "a1"},
                                            {Paper::kLetter, "letter"},
                                            {Paper::kNone, "none"}}};

/// Width and height, mm.
std::pair<double, double> PaperSize(Paper paper) {
  if (paper == Paper::kA3) return {297, 420};
  if (paper == Paper::kA2) return {420, 594};
  if (paper == Paper::kA1) return {594, 841};
  return paper == Paper::kLetter ? std::pair(215.9, 279.4) : std::pair(210.0, 297.0);
}

/// What must be printed: the board with its white margin and the strip below.
struct Needed {
  Eigen::Vector2d print;  // mm
  double quiet = 0, width = 0, height = 0;
};

Needed NeededFor(const BoardPrint& print) {
  Needed needed{(print.high_m - print.low_m) * 1e3};
  needed.quiet = std::max(2.0, print.quiet_m * 1e3);
  needed.width = std::max(needed.print.x() + 2 * needed.quiet, kRulerRoom);
  needed.height = needed.print.y() + 2 * needed.quiet + kStrip;
  return needed;
}

/// Width and height of the page; the paper is turned when only that fits. Empty: it does not fit.
std::optional<std::pair<double, double>> PageFor(const Needed& needed, Paper paper) {
  if (paper == Paper::kNone) return std::pair(needed.width, needed.height);
  const auto [x, y] = PaperSize(paper);
  const auto fits = [&](double width, double height) {
    return needed.width <= width - 2 * kPrinterMargin && needed.height <= height - 2 * kPrinterMargin;
  };
  if (fits(x, y)) return std::pair(x, y);
  return fits(y, x) ? std::optional(std::pair(y, x)) : std::nullopt;
}

[[noreturn]] void ThrowTooLarge(const Board& board, const Needed& needed, Paper paper) {
  const auto [x, y] = PaperSize(paper);
  const std::optional<Board> largest = LargestOn(board, paper);
  throw UsageError(Format("board %s needs %.1f x %.1f mm with its margin and ruler, but %s leaves %.1f x %.1f mm; ",
                          ToString(board).c_str(), needed.width, needed.height, std::string(ToString(paper)).c_str(),
                          x - 2 * kPrinterMargin, y - 2 * kPrinterMargin) +
                   (largest ? "the largest of its kind there is " + ToString(*largest) + "; " : "") +
                   "take that or larger paper (option 'paper' a3, a2, a1 or none)");
}

void AddRuler(double x, double y, BoardPage* page) {
  constexpr double kLine = 0.2;
  page->rects.push_back({x - kLine / 2, y, kRuler + kLine, kLine});
  for (int mm = 0; mm <= static_cast<int>(kRuler); ++mm) {
    const double tick = mm % 10 == 0 ? 4 : mm % 5 == 0 ? 2.5 : 1.5;
    page->rects.push_back({x + mm - kLine / 2, y + kLine, kLine, tick});
  }
  for (const int mm : {0, 50, 100}) {
    page->texts.push_back({x + mm + 0.6, y + 4.4, kFont, std::to_string(mm) + (mm == 100 ? " mm" : "")});
  }
}

void AddLine(const std::string& text, double x, double y, double room, BoardPage* page) {
  const double size = std::min(kFont, room / (kCharWidth * static_cast<double>(text.size())));
  page->texts.push_back({x, y, size, text});
}

std::string EscapePdf(const std::string& text) {
  std::string escaped;
  for (char c : text) escaped += c == '(' || c == ')' || c == '\\' ? std::string("\\") + c : std::string(1, c);
  return escaped;
}

std::string EscapeXml(const std::string& text) {
  std::string escaped;
  for (char c : text) escaped += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : std::string(1, c);
  return escaped;
}

/// Four Bezier curves, 0.03 % of the radius off.
std::string PdfDisc(const BoardPage::Disc& d) {
  const double k = 0.5522847498 * d.radius, r = d.radius;
  std::string out = Format("%.5f %.5f m\n", d.x + r, d.y);
  const auto curve = [&](double x1, double y1, double x2, double y2, double x3, double y3) {
    out += Format("%.5f %.5f %.5f %.5f %.5f %.5f c\n", d.x + x1, d.y + y1, d.x + x2, d.y + y2, d.x + x3, d.y + y3);
  };
  curve(r, k, k, r, 0, r), curve(-k, r, -r, k, -r, 0), curve(-r, -k, -k, -r, 0, -r), curve(k, -r, r, -k, r, 0);
  return out;
}

std::string PdfContent(const BoardPage& page) {
  std::string out = Format("q\n%.9f 0 0 %.9f 0 %.6f cm\n", kPtPerMm, -kPtPerMm, page.height * kPtPerMm);
  for (const auto& r : page.rects) out += Format("%.5f %.5f %.5f %.5f re\n", r.x, r.y, r.width, r.height);
  out += page.white_discs ? "f\n1 g\n" : "";
  for (const auto& d : page.discs) out += PdfDisc(d);
  out += "f\nQ\nBT\n";
  for (const auto& t : page.texts) {
    out += Format("/F1 %.4f Tf\n1 0 0 1 %.4f %.4f Tm\n", t.size * kPtPerMm, t.x * kPtPerMm, (page.height - t.y) * kPtPerMm);
    out += "(" + EscapePdf(t.text) + ") Tj\n";
  }
  return out + "ET\n";
}

void AppendBigEndian(uint32_t value, std::string* bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes->push_back(static_cast<char>(value >> shift & 255));
}

uint32_t Crc32(const std::string& bytes) {
  uint32_t crc = ~0u;
  for (unsigned char byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
  }
  return ~crc;
}

/// The chunk that says how many pixels a metre has (PNG specification, 11.3.5.3).
std::string PhysChunk(uint32_t px_per_m) {
  std::string body = "pHYs";
  AppendBigEndian(px_per_m, &body);
  AppendBigEndian(px_per_m, &body);
  body.push_back(1);
  std::string chunk;
  AppendBigEndian(9, &chunk);
  chunk += body;
  AppendBigEndian(Crc32(body), &chunk);
  return chunk;
}

/// Takes the share of every pixel that the rectangle covers from its brightness.
void Darken(const BoardPage::Rect& rect, double px_per_mm, cv::Mat* page) {
  const double x0 = rect.x * px_per_mm, x1 = (rect.x + rect.width) * px_per_mm;
  const double y0 = rect.y * px_per_mm, y1 = (rect.y + rect.height) * px_per_mm;
  const auto share = [](double low, double high, int i) {
    return std::max(0.0, std::min(high, i + 1.0) - std::max(low, double(i)));
  };
  for (int v = std::max(0, static_cast<int>(y0)); v < std::min<double>(page->rows, std::ceil(y1)); ++v) {
    float* row = page->ptr<float>(v);
    const double height = share(y0, y1, v);
    for (int u = std::max(0, static_cast<int>(x0)); u < std::min<double>(page->cols, std::ceil(x1)); ++u) {
      row[u] -= static_cast<float>(255 * height * share(x0, x1, u));
    }
  }
}

/// Sets the pixels of the disc to its colour by the share that it covers, of its edge from 16 x 16 samples.
void Cover(const BoardPage::Disc& disc, double px_per_mm, float colour, cv::Mat* page) {
  constexpr int kSamples = 16;
  const double x = disc.x * px_per_mm, y = disc.y * px_per_mm, radius = disc.radius * px_per_mm;
  for (int v = std::max(0, static_cast<int>(y - radius)); v < std::min<double>(page->rows, y + radius); ++v) {
    float* row = page->ptr<float>(v);
    for (int u = std::max(0, static_cast<int>(x - radius)); u < std::min<double>(page->cols, x + radius); ++u) {
      int inside = 0;
      for (int i = 0; i < kSamples * kSamples; ++i)
        inside += std::hypot(u + (i % kSamples + 0.5) / kSamples - x, v + (i / kSamples + 0.5) / kSamples - y) <= radius;
      const float share = static_cast<float>(inside) / (kSamples * kSamples);
      row[u] = (1 - share) * row[u] + share * colour;
    }
  }
}

}  // namespace

std::string_view ToString(Paper paper) { return WordOf(kPapers, paper); }

void FromString(const std::string& text, Paper* paper) {
  *paper = KnownChoice(kPapers, text, "option 'paper' " + text + " is unknown: use a4, a3, a2, a1, letter or none");
}

bool FitsPaper(const Board& board, const BoardDrawOptions& options) {
  return PageFor(NeededFor(PrintOf(board)), options.paper).has_value();
}

BoardPage LayOutBoard(const Board& board, const BoardDrawOptions& options) {
  if (options.back && !board.back_m)
    throw UsageError("board " + ToString(board) +
                     " has one side: option 'back' draws that of a board with two-sided=THICKNESS");
  const BoardPrint print = PrintOf(board);
  const Needed needed = NeededFor(print);
  const auto& [size, quiet, width, height] = needed;
  const auto room = PageFor(needed, options.paper);
  if (!room) ThrowTooLarge(board, needed, options.paper);
  BoardPage page;
  std::tie(page.width, page.height) = *room;
  page.board_x = (page.width - size.x()) / 2;
  page.board_y = (page.height - height) / 2 + quiet;
  for (const PrintRect& r : print.black) {
    const Eigen::Vector2d low = (r.low - print.low_m) * 1e3, extent = (r.high - r.low) * 1e3;
    const double x = options.back ? size.x() - low.x() - extent.x() : low.x();
    page.rects.push_back({page.board_x + x, page.board_y + low.y(), extent.x(), extent.y()});
  }
  for (const PrintDisc& d : print.discs) {
    const Eigen::Vector2d at = (d.centre - print.low_m) * 1e3;
    page.discs.push_back({page.board_x + at.x(), page.board_y + at.y(), 1e3 * d.radius});
  }
  page.white_discs = print.white_discs;
  const double left = (page.width - width) / 2 + 3, below = page.board_y + size.y() + quiet;
  AddRuler(left, below, &page);
  AddLine(ToString(board) + (options.back ? ", back" : ""), left, below + 9, width - 6, &page);
  AddLine("print at 100 % (do not fit to the page); the ruler must measure 100 mm", left, below + 13, width - 6, &page);
  return page;
}

std::string ToPdf(const BoardPage& page) {
  const std::string content = PdfContent(page);
  const std::vector<std::string> objects = {
      "<< /Type /Catalog /Pages 2 0 R >>", "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      Format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 %.4f %.4f] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
             page.width * kPtPerMm, page.height * kPtPerMm),
      "<< /Length " + std::to_string(content.size()) + " >>\nstream\n" + content + "endstream",
      "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"};
  std::string pdf = "%PDF-1.4\n", table = Format("xref\n0 %zu\n0000000000 65535 f \n", objects.size() + 1);
  for (size_t i = 0; i < objects.size(); ++i) {
    table += Format("%010zu 00000 n \n", pdf.size());
    pdf += std::to_string(i + 1) + " 0 obj\n" + objects[i] + "\nendobj\n";
  }
  const size_t start = pdf.size();
  return pdf + table + Format("trailer\n<< /Size %zu /Root 1 0 R >>\nstartxref\n%zu\n%%%%EOF\n", objects.size() + 1, start);
}

std::string ToSvg(const BoardPage& page) {
  std::string svg = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  svg += Format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.4fmm\" height=\"%.4fmm\" viewBox=\"0 0 %.4f %.4f\">\n",
                page.width, page.height, page.width, page.height);
  svg += Format("<rect width=\"%.4f\" height=\"%.4f\" fill=\"#fff\"/>\n<path fill=\"#000\" d=\"", page.width, page.height);
  for (const auto& r : page.rects) svg += Format("M%.5f %.5fh%.5fv%.5fh%.5fz\n", r.x, r.y, r.width, r.height, -r.width);
  svg += "\"/>\n";
  for (const auto& d : page.discs)
    svg += Format("<circle cx=\"%.5f\" cy=\"%.5f\" r=\"%.5f\" fill=\"%s\"/>\n", d.x, d.y, d.radius,
                  page.white_discs ? "#fff" : "#000");
  for (const auto& t : page.texts) {
    svg +=
        Format("<text x=\"%.4f\" y=\"%.4f\" font-family=\"Helvetica,Arial,sans-serif\" font-size=\"%.4f\">", t.x, t.y, t.size);
    svg += EscapeXml(t.text) + "</text>\n";
  }
  return svg + "</svg>\n";
}

std::string ToPng(const BoardPage& page, double dpi) {
  if (!(dpi >= 20 && dpi <= 4800)) throw UsageError("option 'dpi' must be from 20 to 4800");
  const auto px_per_m = static_cast<uint32_t>(std::lround(dpi / 0.0254));
  const double px_per_mm = px_per_m * 1e-3;
  const double width = std::ceil(page.width * px_per_mm - 1e-6), height = std::ceil(page.height * px_per_mm - 1e-6);
  if (width * height > kMaxPixels)
    throw UsageError(Format("%.0f x %.0f pixels are too many; lower option 'dpi'", width, height));
  cv::Mat ink(static_cast<int>(height), static_cast<int>(width), CV_32F, cv::Scalar(255)), grey;
  for (const auto& rect : page.rects) Darken(rect, px_per_mm, &ink);
  for (const auto& disc : page.discs) Cover(disc, px_per_mm, page.white_discs ? 255 : 0, &ink);
  ink.convertTo(grey, CV_8U);
  constexpr double kCapHeight = 22;  // px of the font at scale 1
  for (const auto& t : page.texts) {
    const cv::Point at(static_cast<int>(t.x * px_per_mm), static_cast<int>(t.y * px_per_mm));
    cv::putText(grey, t.text, at, cv::FONT_HERSHEY_SIMPLEX, 0.7 * t.size * px_per_mm / kCapHeight, cv::Scalar(0),
                std::max(1, static_cast<int>(0.08 * t.size * px_per_mm)), cv::LINE_AA);
  }
  std::vector<uint8_t> bytes;
  cv::imencode(".png", grey, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6});
  std::string png(bytes.begin(), bytes.end());
  constexpr size_t kAfterHeader = 8 + 25;  // signature and IHDR chunk
  return png.insert(kAfterHeader, PhysChunk(px_per_m));
}

void WriteBoardPage(const Board& board, const std::string& path, const BoardDrawOptions& options) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".pdf" && extension != ".svg" && extension != ".png") {
    throw UsageError("option 'out' " + path + ": the name must end in .pdf, .svg or .png");
  }
  const BoardPage page = LayOutBoard(board, options);
  WriteFileAtomic(path, extension == ".pdf" ? ToPdf(page) : extension == ".svg" ? ToSvg(page) : ToPng(page, options.dpi));
}

}  // namespace mvstudio::calib
