"""A recorded run in other formats: tables, films, pages, bags and recordings of other programs."""
