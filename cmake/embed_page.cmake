# SPDX-License-Identifier: Apache-2.0
# Writes a source file with the parts of the page as strings:
#
#   cmake -D OUTPUT=FILE.cpp -D PARTS=page.html;page.css;page.js -P embed_page.cmake
set(code "// Made from the files in src/cli/page by cmake/embed_page.cmake.\n")
string(APPEND code "#include \"cli/page/page_text.h\"\n\nnamespace driftlight::cli {\n\n")
foreach(part IN LISTS PARTS)
  get_filename_component(kind "${part}" LAST_EXT)
  string(REPLACE "." "" kind "${kind}")
  string(TOUPPER "${kind}" kind)
  file(READ "${part}" text)
  string(APPEND code "const std::string_view kPage${kind} = R\"page-text(${text})page-text\";\n\n")
endforeach()
string(APPEND code "}  // namespace driftlight::cli\n")
file(WRITE "${OUTPUT}" "${code}")
